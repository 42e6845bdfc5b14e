//! The file of a model, and the model that the program has.
//!
//! Safetensors with one tensor per field of [`Body`], small enough to be part of the program: vertices in tenths of a
//! millimetre, components as i16 (the first [`FINE`]) and i8 with a scale each, shares and colours in steps of 1/255.

use crate::body::{Body, JOINTS};
use crate::extra_joints::{OF_FACE, OF_FINGERS, WITH_FINGERS};
use crate::packed;
use crate::tensors::{FileError, Tensors, finite, floats, indices, rows, units};
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};
use std::collections::HashMap;
use std::sync::OnceLock;

/// Learned from the VALID avatars without those on whom models are measured: `yoto-lab body` with `--without
/// Hispanic_M_2 White_M_1 NHPI_M_1 Asian_F_1 Black_M_1 White_F_2 Hispanic_F_1 AIAN_M_1 Asian_M_3 Black_F_3`. [`NOTICE`] is
/// its licence.
static PEOPLE: &[u8] = include_bytes!("body.safetensors");
/// The licence of the bodies that models are learned from, which every file has with it.
const NOTICE: &str = include_str!("LICENSE-bodies");
/// Version of the format.
const VERSION: &str = "1";
/// Number of shape components, the largest, with 16 bits per number. With 8 bits their steps would show as a rough
/// surface: normals would be 3.5° off in the median, and are 1.0°.
pub const FINE: usize = 8;
/// Most vertices: indices have 16 bits.
const MOST_VERTICES: usize = 1 << 16;
/// Most components of shapes, and of colours.
const MOST_COMPONENTS: usize = 512;
/// Most vertices that a joint is regressed from.
pub(crate) const MOST_SHARES: usize = 32;
/// Largest difference between 1 and a sum of shares.
const SHARES_OFF: f32 = 1e-3;

impl Body {
    /// The model that the program has.
    ///
    /// # Panics
    /// Never: a test reads the file.
    pub fn people() -> &'static Self {
        static BODY: OnceLock<Body> = OnceLock::new();
        BODY.get_or_init(|| {
            Self::from_bytes(PEOPLE).expect("a test reads the file that the program is built with")
        })
    }

    /// The model that the program has, for a skeleton with this number of joints: [`JOINTS`], or those and the fingers', or those and
    /// the face's too.
    ///
    /// # Panics
    /// Never: a test reads the file, which has fingers and a face.
    pub fn for_joints(joints: usize) -> &'static Self {
        static FINGERED: OnceLock<Body> = OnceLock::new();
        static WITH_FACE: OnceLock<Body> = OnceLock::new();
        let read = "a test reads the file that the program is built with";
        if joints <= JOINTS {
            Self::people()
        } else if joints <= WITH_FINGERS {
            FINGERED.get_or_init(|| Self::people().with_fingers().expect(read))
        } else {
            WITH_FACE.get_or_init(|| Self::people().with_face().expect(read))
        }
    }

    /// Reads a model's file.
    ///
    /// # Errors
    /// If the bytes are not a model's file. The error names the tensor.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, FileError> {
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(FileError::Format)?;
        let version = header
            .metadata()
            .as_ref()
            .and_then(|notes| notes.get("version"));
        if version.is_none_or(|version| version != VERSION) {
            let found = version.map_or("unknown", String::as_str);
            return Err(FileError::Version(found.chars().take(40).collect()));
        }
        let file = Tensors(SafeTensors::deserialize(bytes).map_err(FileError::Format)?);
        let v = file.count("mean", 1..=MOST_VERTICES)?;
        let f = file.count("faces", 1..=8 * MOST_VERTICES)?;
        let c = file.count("shape_scales", 0..=MOST_COMPONENTS)?;
        let d = file.count("colour_scales", 0..=MOST_COMPONENTS)?;
        let (fine, size) = (c.min(FINE), 3 * v);

        let scales = file.floats("shape_scales", &[c])?;
        let first = file.get("shapes_fine", Dtype::I16, &[fine, v, 3])?;
        let rest = file.get("shapes", Dtype::I8, &[c - fine, v, 3])?;
        let mut shapes = packed::unpack_fine(first, &scales[..fine], size);
        shapes.extend(packed::unpack_coarse(rest, &scales[fine..], size));
        let scales = file.floats("colour_scales", &[d])?;
        let colours = file.get("colours", Dtype::I8, &[d, v, 3])?;
        let colours = packed::unpack_coarse(colours, &scales, size);
        let joints = regressor(&file, ["joint_vertices", "joint_shares"], JOINTS, v)?;
        let (bones, weights) = skinning(&file, ["bones", "weights"], v, JOINTS)?;
        let part = file.get("part", Dtype::U8, &[v])?;
        if part.iter().any(|part| *part > 2) {
            return Err(FileError::Number("part"));
        }
        let mean = packed::unpack_metres(file.get("mean", Dtype::I16, &[v, 3])?);
        let colour_mean = packed::unpack_unit(file.get("colour_mean", Dtype::U8, &[v, 3])?);
        let uv = file.shorts("uv", &[v, 2])?;
        let uv: Vec<f32> = uv
            .map(|step| f32::from(step) / f32::from(u16::MAX))
            .collect();
        Ok(Self {
            mean: rows(&mean),
            shapes: rows(&shapes),
            colour_mean: rows(&colour_mean),
            colours: rows(&colours),
            faces: rows(&file.indices("faces", &[f, 3], v)?),
            uv: rows(&uv),
            joints,
            bones,
            weights,
            mirror: file.indices("mirror", &[v], v)?,
            part: part.to_vec(),
            welded: file.indices("welded", &[v], v)?,
            fingers: OF_FINGERS.read(&file, v)?,
            face: OF_FACE.read(&file, v)?,
        })
    }

    /// The file of this model, with the notice of the licence.
    ///
    /// # Errors
    /// If the model's fields are of different lengths, or a number is not finite or beyond what the file can hold.
    pub fn to_bytes(&self) -> Result<Vec<u8>, FileError> {
        let (v, f) = (self.mean.len(), self.faces.len());
        let (c, d) = (self.shape_components(), self.colour_components());
        let (fine, size) = (c.min(FINE), 3 * v);
        let shapes = finite("shapes", self.shapes.as_flattened())?;
        let (first, rest) = shapes
            .split_at_checked(fine * size)
            .unwrap_or((shapes, &[]));
        let (first, rest) = (
            packed::pack_fine(first, size),
            packed::pack_coarse(rest, size),
        );
        let colours = finite("colours", self.colours.as_flattened())?;
        let colours = packed::pack_coarse(colours, size);
        let scales = [first.scales, rest.scales].concat();
        let mean = packed::pack_metres(self.mean.as_flattened());
        let colour_mean = finite("colour_mean", self.colour_mean.as_flattened())?;
        let weights = shares("weights", &self.weights)?;
        let (joint_vertices, joint_shares) =
            joint_rows(&self.joints, ["joint_vertices", "joint_shares"])?;
        let mut tensors = vec![
            (
                "mean",
                Dtype::I16,
                vec![v, 3],
                mean.ok_or(FileError::Number("mean"))?,
            ),
            ("shapes_fine", Dtype::I16, vec![fine, v, 3], first.bytes),
            ("shapes", Dtype::I8, vec![c - fine, v, 3], rest.bytes),
            ("shape_scales", Dtype::F32, vec![c], floats(&scales)),
            (
                "colour_mean",
                Dtype::U8,
                vec![v, 3],
                packed::pack_unit(colour_mean),
            ),
            ("colours", Dtype::I8, vec![d, v, 3], colours.bytes),
            (
                "colour_scales",
                Dtype::F32,
                vec![d],
                floats(&colours.scales),
            ),
            (
                "faces",
                Dtype::U16,
                vec![f, 3],
                indices("faces", self.faces.as_flattened())?,
            ),
            (
                "uv",
                Dtype::U16,
                vec![v, 2],
                units("uv", self.uv.as_flattened())?,
            ),
            (
                "joint_vertices",
                Dtype::U16,
                vec![JOINTS, MOST_SHARES],
                indices("joint_vertices", &joint_vertices)?,
            ),
            (
                "joint_shares",
                Dtype::F32,
                vec![JOINTS, MOST_SHARES],
                floats(&joint_shares),
            ),
            ("bones", Dtype::U8, vec![v, 4], self.bones.concat()),
            ("weights", Dtype::U8, vec![v, 4], weights),
            (
                "mirror",
                Dtype::U16,
                vec![v],
                indices("mirror", &self.mirror)?,
            ),
            ("part", Dtype::U8, vec![v], self.part.clone()),
            (
                "welded",
                Dtype::U16,
                vec![v],
                indices("welded", &self.welded)?,
            ),
        ];
        for (extra, tail) in [(&self.fingers, OF_FINGERS), (&self.face, OF_FACE)] {
            if let Some(extra) = extra {
                tensors.extend(tail.tensors(extra)?);
            }
        }
        let mut views = Vec::with_capacity(tensors.len());
        for (name, dtype, shape, bytes) in &tensors {
            let wrong = |_| FileError::Shape {
                tensor: name,
                found: format!("{} bytes", bytes.len()),
                expected: format!("{dtype:?} {shape:?}"),
            };
            let view = TensorView::new(*dtype, shape.clone(), bytes).map_err(wrong)?;
            views.push((*name, view));
        }
        let notes = [("version", VERSION), ("licence", NOTICE)];
        let notes: HashMap<String, String> = notes.map(|(a, b)| (a.into(), b.into())).into();
        safetensors::serialize(views, Some(notes)).map_err(FileError::Format)
    }
}

/// A tensor of a file: name, type, shape and bytes.
pub(crate) type NewTensor = (&'static str, Dtype, Vec<usize>, Vec<u8>);

/// The regressor of `count` joints: vertices, of which there are `v`, and their shares.
pub(crate) fn regressor(
    file: &Tensors<'_>,
    [vertices, shares]: [&'static str; 2],
    count: usize,
    v: usize,
) -> Result<Vec<Vec<(u32, f32)>>, FileError> {
    let numbers = file.floats(shares, &[count, MOST_SHARES])?;
    let vertices = file.indices(vertices, &[count, MOST_SHARES], v)?;
    let pairs: Vec<(u32, f32)> = vertices.into_iter().zip(numbers).collect();
    joints_of_rows(&pairs, shares)
}

/// Joints of vertices, `[V]`, and their shares, `[V]`.
type Skinning = (Vec<[u8; 4]>, Vec<[f32; 4]>);

/// Joints of vertices, of which there are `v`, below `joints`, and their shares.
pub(crate) fn skinning(
    file: &Tensors<'_>,
    [bones, weights]: [&'static str; 2],
    v: usize,
    joints: usize,
) -> Result<Skinning, FileError> {
    let of_joints = file.get(bones, Dtype::U8, &[v, 4])?;
    if of_joints.iter().any(|bone| usize::from(*bone) >= joints) {
        return Err(FileError::Number(bones));
    }
    let steps = file.get(weights, Dtype::U8, &[v, 4])?.as_chunks::<4>().0;
    let whole = |row: &[u8; 4]| row.iter().map(|step| u16::from(*step)).sum::<u16>() == 255;
    if !steps.iter().all(whole) {
        return Err(FileError::Shares(weights));
    }
    let share = |row: &[u8; 4]| row.map(|step| f32::from(step) / 255.0);
    Ok((rows(of_joints), steps.iter().map(share).collect()))
}

/// The bytes of shares `[V, 4]` in steps of 1/255.
pub(crate) fn shares(tensor: &'static str, weights: &[[f32; 4]]) -> Result<Vec<u8>, FileError> {
    if !(weights.iter()).all(|row| sum_to_one(row.iter().copied())) {
        return Err(FileError::Shares(tensor));
    }
    Ok((weights.iter())
        .flat_map(|row| packed::pack_shares(*row))
        .collect())
}

/// The regressor in rows of [`MOST_SHARES`] pairs, without the pairs that fill up a row.
fn joints_of_rows(
    pairs: &[(u32, f32)],
    tensor: &'static str,
) -> Result<Vec<Vec<(u32, f32)>>, FileError> {
    let joint = |row: &[(u32, f32)]| -> Result<Vec<(u32, f32)>, FileError> {
        let shares = row.iter().map(|(_, share)| *share);
        if !sum_to_one(shares) {
            return Err(FileError::Shares(tensor));
        }
        Ok(row
            .iter()
            .copied()
            .filter(|(_, share)| *share > 0.0)
            .collect())
    };
    pairs.chunks_exact(MOST_SHARES).map(joint).collect()
}

/// The regressor as rows of [`MOST_SHARES`] vertices and shares, `[K, 32]`; a share of 0 fills up a row.
pub(crate) fn joint_rows(
    joints: &[Vec<(u32, f32)>],
    [vertices, shares]: [&'static str; 2],
) -> Result<(Vec<u32>, Vec<f32>), FileError> {
    let mut pairs = Vec::with_capacity(joints.len() * MOST_SHARES);
    for joint in joints {
        if joint.len() > MOST_SHARES {
            return Err(FileError::Shape {
                tensor: vertices,
                found: format!("{} vertices for a joint", joint.len()),
                expected: format!("at most {MOST_SHARES}"),
            });
        }
        if !sum_to_one(joint.iter().map(|(_, share)| *share)) {
            return Err(FileError::Shares(shares));
        }
        pairs.extend(joint);
        pairs.resize(pairs.len() + MOST_SHARES - joint.len(), (0, 0.0));
    }
    Ok(pairs.into_iter().unzip())
}

/// Whether shares are not negative and sum to 1, but for rounding.
fn sum_to_one(mut shares: impl Iterator<Item = f32> + Clone) -> bool {
    let sum: f32 = shares.clone().sum();
    shares.all(|share| share >= 0.0) && (sum - 1.0).abs() <= SHARES_OFF
}
