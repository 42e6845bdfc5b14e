//! Rest joints from the body models SMPL and SMPL-X. Their licences keep them out of this project:
//! the user provides a copy.
//!
//! joints = J_regressor · (v_template + shapedirs · betas), with `v_template` `[V, 3]`,
//! `shapedirs` `[V, 3, B]` and `J_regressor` `[24, V]` (dense in `.npz`, one of scipy's sparse
//! matrices in `.pkl`). The sum is linear in betas, so that only `[24, 3, 1 + B]` is kept. SMPL-X has
//! 55 joints: the first 22 are SMPL's, and where the middle fingers begin is SMPL's hand.

use crate::ImportError;
use crate::geometry::Vec3;
use crate::source::{Part, Source};
use std::path::Path;
use yoto_formats::Array;
use yoto_proto::smpl::JOINTS;

/// Joints of SMPL-X.
const SMPLX_JOINTS: usize = 55;
/// Joints of SMPL-X that are SMPL's hands: where the middle fingers begin.
const HANDS: [(usize, usize); 2] = [(28, 22), (43, 23)];

/// Rest joints by shape parameters.
#[derive(Clone, Debug)]
pub struct BodyModel {
    /// Whether it is SMPL-X, whose shapes and pelvis differ from SMPL's.
    is_smplx: bool,
    mean: Vec<Vec3>,
    /// Displacement of the joints per unit of each shape parameter.
    shapes: Vec<Vec<Vec3>>,
}

impl BodyModel {
    /// Reads a `.npz` or a `.pkl`.
    ///
    /// # Errors
    /// When the file is neither, or lacks one of the arrays.
    pub fn open(path: &Path) -> Result<Self, ImportError> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let source = Source::new(folder);
        let data = source.data(&name, None)?;
        let root = data.root();
        let (template, shapes) = (root.get("v_template")?, root.get("shapedirs")?);
        let vertices = template.rows::<3>()?;
        let directions = shapes.array()?;
        let count = match directions.shape[..] {
            [v, 3, count] if v == vertices.len() => count,
            _ => {
                let message = format!(
                    "the shape is {:?}, {} vertices need [{}, 3, any]",
                    directions.shape,
                    vertices.len(),
                    vertices.len()
                );
                return Err(shapes.fault("SIZE_MISMATCH", message));
            }
        };
        let (count_of_joints, weights) = regressor(&root.get("J_regressor")?, vertices.len())?;
        let is_smplx = count_of_joints == SMPLX_JOINTS;
        let weights: Vec<(usize, usize, f64)> = weights
            .into_iter()
            .filter_map(|(joint, vertex, weight)| {
                let hand = HANDS.iter().find(|(from, _)| is_smplx && *from == joint);
                let to = hand.map_or(joint, |(_, to)| *to);
                (hand.is_some() || !is_smplx || joint < 22).then_some((to, vertex, weight))
            })
            .collect();
        let joints = |value: &dyn Fn(usize, usize) -> f64| -> Vec<Vec3> {
            let mut joints = vec![[0.0; 3]; JOINTS.len()];
            for &(joint, vertex, weight) in &weights {
                if let Some(position) = joints.get_mut(joint) {
                    for (axis, sum) in position.iter_mut().enumerate() {
                        *sum += weight * value(vertex, axis);
                    }
                }
            }
            joints
        };
        let direction = |vertex: usize, axis: usize, shape: usize| {
            let at = (vertex * 3 + axis) * count + shape;
            directions.values.get(at).copied().unwrap_or_default()
        };
        Ok(Self {
            is_smplx,
            mean: joints(&|vertex, axis| vertices[vertex][axis]),
            shapes: (0..count)
                .map(|shape| joints(&|vertex, axis| direction(vertex, axis, shape)))
                .collect(),
        })
    }

    /// Whether this is SMPL-X.
    pub fn is_smplx(&self) -> bool {
        self.is_smplx
    }

    /// The 24 rest joints, metres. Parameters beyond those of the model are ignored: models
    /// have 10 or 300, and those beyond 10 move joints by millimetres.
    pub fn joints(&self, betas: &[f64]) -> Vec<Vec3> {
        let mut joints = self.mean.clone();
        for (beta, moves) in betas.iter().zip(&self.shapes) {
            for (joint, by) in joints.iter_mut().zip(moves) {
                *joint = std::array::from_fn(|axis| joint[axis] + beta * by[axis]);
            }
        }
        joints
    }
}

/// Joint, vertex and weight.
type Weights = Vec<(usize, usize, f64)>;

/// The number of joints, and every weight that is not 0.
fn regressor(part: &Part<'_>, vertices: usize) -> Result<(usize, Weights), ImportError> {
    let fits = |shape: &[usize]| match *shape {
        [joints, of] if of == vertices && [JOINTS.len(), SMPLX_JOINTS].contains(&joints) => {
            Ok(joints)
        }
        _ => {
            let message = format!(
                "the shape is {shape:?}, but SMPL has [24, {vertices}] and SMPL-X [55, {vertices}]"
            );
            Err(part.fault("SIZE_MISMATCH", message))
        }
    };
    let Some(data) = part.find("data") else {
        let Array { shape, values } = part.array()?;
        let joints = fits(&shape)?;
        let weights = values
            .iter()
            .enumerate()
            .filter(|(_, weight)| **weight != 0.0);
        let weights = weights.map(|(at, weight)| (at / vertices, at % vertices, *weight));
        return Ok((joints, weights.collect()));
    };
    let shape = part.find("_shape").or_else(|| part.find("shape"));
    let shape = shape.ok_or_else(|| part.fault("MISSING", "the sparse matrix has no shape"))?;
    let shape: Vec<usize> = shape.vector()?.iter().map(|side| *side as usize).collect();
    let joints = fits(&shape)?;
    let indices_of = |name: &str| -> Result<Vec<usize>, ImportError> {
        let values = part.get(name)?.vector()?;
        Ok(values.iter().map(|value| *value as usize).collect())
    };
    let values = data.vector()?;
    let pairs: Vec<(usize, usize)> = if let Some(rows) = part.find("row") {
        let rows = rows.vector()?.into_iter().map(|row| row as usize);
        rows.zip(indices_of("col")?).collect()
    } else {
        let (starts, indices) = (indices_of("indptr")?, indices_of("indices")?);
        let by_rows = starts.len() == shape[0] + 1;
        let mut pairs = Vec::with_capacity(indices.len());
        for (major, ends) in starts.windows(2).enumerate() {
            let inside = indices.get(ends[0]..ends[1]);
            let inside = inside.ok_or_else(|| part.fault("SIZE_MISMATCH", "indptr leads out"))?;
            pairs.extend(inside.iter().map(|&minor| {
                if by_rows {
                    (major, minor)
                } else {
                    (minor, major)
                }
            }));
        }
        pairs
    };
    let inside = |&(joint, vertex): &(usize, usize)| joint < shape[0] && vertex < vertices;
    if pairs.len() != values.len() || !pairs.iter().all(inside) {
        return Err(part.fault("SIZE_MISMATCH", "the sparse matrix leads outside its shape"));
    }
    let weights = pairs.into_iter().zip(values);
    let weights = weights.map(|((joint, vertex), weight)| (joint, vertex, weight));
    Ok((joints, weights.collect()))
}
