//! The bodies to learn from, and how they are read.

use super::fingers::{bones_of_rig, of_rig, weights_of_rig};
use super::{LearnError, face, symmetry};
use crate::body::{JOINTS, joints_of};
use crate::extra_joints::{ExtraJoints, FINGERS};
use thiserror::Error;
use yoto_formats::npz::{self, NpzError};
use yoto_formats::{Array, Value};

/// Most bytes that an archive may unpack to.
const MOST_BYTES: u64 = 1 << 30;
/// Units of a vertex per metre.
const PER_METRE: f64 = 10_000.0;

/// Why bodies can't be read.
#[derive(Debug, Error)]
pub enum ReadError {
    /// Not an archive of arrays.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// An array is missing, or no array of numbers.
    #[error("{0}: the array is missing, or has no numbers")]
    Missing(&'static str),
    /// An array of another shape.
    #[error("{array}: its shape is {shape:?}, and should be {expected}")]
    Shape {
        /// Its name.
        array: &'static str,
        /// Its shape.
        shape: Vec<usize>,
        /// What it should be.
        expected: String,
    },
    /// A number that is not finite or not allowed.
    #[error("{array}: {number} is out of range")]
    Number {
        /// Name of the array.
        array: &'static str,
        /// The number.
        number: f64,
    },
}

/// What all bodies share.
pub(crate) struct Topology {
    /// `[F]`.
    pub(crate) faces: Vec<[u32; 3]>,
    /// `[V]`.
    pub(crate) uv: Vec<[f32; 2]>,
    /// `[V]`.
    pub(crate) part: Vec<u8>,
    /// `[V]`.
    pub(crate) bones: Vec<[u8; 4]>,
    /// `[V]`.
    pub(crate) weights: Vec<[f32; 4]>,
    /// The weight of each finger's joint, `[V, 30]`, if the rig of the bodies has fingers.
    pub(crate) finger_weights: Option<Vec<[f32; FINGERS]>>,
}

/// N bodies in dense correspondence: vertex i is the same place of every body.
pub struct Bodies {
    /// `[N]`: the identity, `_`, and the outfit.
    pub(crate) names: Vec<String>,
    /// `[N, V]`, metres.
    pub(crate) vertices: Vec<Vec<[f32; 3]>>,
    /// `[N, V]`, 0 to 1, sRGB.
    pub(crate) colours: Vec<Vec<[f32; 3]>>,
    /// `[N, K]`, metres, with the fingers' joints after SMPL's if the rig has them.
    pub(crate) joints: Vec<Vec<[f32; 3]>>,
    pub(crate) topology: Topology,
}

/// One body at rest, and what carries it.
#[derive(Clone, Debug)]
pub struct BodyMesh {
    /// The identity, `_`, and the outfit.
    pub name: String,
    /// `[V]`, metres.
    pub vertices: Vec<[f32; 3]>,
    /// `[V]`, 0 to 1, sRGB.
    pub colours: Vec<[f32; 3]>,
    /// `[K]`, metres.
    pub joints: Vec<[f32; 3]>,
    /// `[F]`.
    pub faces: Vec<[u32; 3]>,
    /// `[V]`, the joints that carry a vertex.
    pub bones: Vec<[u8; 4]>,
    /// `[V]`, their weights.
    pub weights: Vec<[f32; 4]>,
}

impl Bodies {
    /// The body called `name`, with the joints of fingers and face if `parts` are wanted.
    ///
    /// # Errors
    /// If no body has this name, or the bodies have no fingers. The error gives the name of a body that exists.
    pub fn mesh(&self, name: &str, parts: bool) -> Result<BodyMesh, LearnError> {
        let index = self
            .names
            .iter()
            .position(|it| it.eq_ignore_ascii_case(name));
        let index =
            index.ok_or_else(|| LearnError::Body(name.to_owned(), self.names[0].clone()))?;
        let mut mesh = BodyMesh {
            name: name.to_owned(),
            vertices: self.vertices[index].clone(),
            colours: self.colours[index].clone(),
            joints: self.joints[index][..JOINTS].to_vec(),
            faces: self.topology.faces.clone(),
            bones: self.topology.bones.clone(),
            weights: self.topology.weights.clone(),
        };
        if parts {
            let weights = self.topology.finger_weights.as_deref();
            let weights = weights.ok_or(LearnError::NoFingers)?;
            let fingers = of_rig(&self.topology, weights, Vec::new());
            let face = self.face().ok_or(LearnError::NoFingers)?;
            mesh.joints.clone_from(&self.joints[index]);
            mesh.joints.extend(joints_of(&face.joints, &mesh.vertices));
            for own in [fingers, face] {
                for (i, vertex) in own.vertices.iter().enumerate() {
                    mesh.bones[*vertex as usize] = own.bones[i];
                    mesh.weights[*vertex as usize] = own.weights[i];
                }
            }
        }
        Ok(mesh)
    }

    /// The face of all bodies, by their mean; `None` without eyes.
    fn face(&self) -> Option<ExtraJoints> {
        let all = 0..self.names.len();
        let all: Vec<(usize, f64)> = all.map(|it| (it, 1.0 / self.names.len() as f64)).collect();
        let mean = self.mean(&all);
        let welded = symmetry::weld(self, &all, &mean);
        face::of(&self.topology, &mean, &welded)
    }

    /// Reads bodies from the bytes of two archives of numpy.
    ///
    /// `bodies.npz` has `names` `[N]`, `vertices` `[N, V, 3]` in tenths of a millimetre, `colours` `[N, V, 3]` from 0 to
    /// 255 and `joints` `[N, 24, 3]` in metres. `topology.npz` has `faces` `[F, 3]`, `uv` `[V, 2]`, `part` `[V]`, and
    /// `weight_joint` and `weight` `[V, 4]`, weights from 0 to 255. Bodies have fingers if their rig's bones are there: in
    /// `topology.npz` `rig_names` `[R]`, and `rig_weight_joint` and `rig_weight` `[V, 4]`, in `bodies.npz` `rig_rest` `[N, R, 3]`.
    ///
    /// # Errors
    /// If the bytes are no such archives. The error names the array.
    pub fn read(bodies: &[u8], topology: &[u8]) -> Result<Self, ReadError> {
        let bodies = npz::read(bodies, MOST_BYTES)?;
        let names = bodies
            .get("names")
            .and_then(Value::items)
            .unwrap_or_default();
        let names: Vec<String> = names
            .iter()
            .filter_map(|name| name.text().map(str::to_owned))
            .collect();
        let n = names.len();
        let vertices = array(&bodies, "vertices")?;
        let v = vertices.shape.get(1).copied().unwrap_or(0);
        if n == 0 || v == 0 {
            return Err(ReadError::Shape {
                array: if n == 0 { "names" } else { "vertices" },
                shape: vertices.shape.clone(),
                expected: "[N, V, 3] with a name for each of N bodies".into(),
            });
        }
        let of_bodies =
            |name: &'static str, rows: usize, unit: f64| -> Result<Vec<Vec<[f32; 3]>>, ReadError> {
                let numbers = shaped(&bodies, name, &[n, rows, 3])?;
                let place = |row: &[f64; 3]| row.map(|number| (number / unit) as f32);
                let body = |body: &[[f64; 3]]| body.iter().map(place).collect();
                Ok(numbers
                    .as_chunks::<3>()
                    .0
                    .chunks_exact(rows)
                    .map(body)
                    .collect())
            };
        let archive = npz::read(topology, MOST_BYTES)?;
        let mut joints = of_bodies("joints", JOINTS, 1.0)?;
        let names_of_rig = archive.get("rig_names");
        let fingers = names_of_rig.and_then(bones_of_rig);
        if let Some(fingers) = &fingers {
            let bones = names_of_rig.and_then(Value::items).map_or(0, <[_]>::len);
            for (joints, rig) in joints.iter_mut().zip(of_bodies("rig_rest", bones, 1.0)?) {
                joints.extend(fingers.iter().map(|bone| rig[*bone]));
            }
        }
        Ok(Self {
            vertices: of_bodies("vertices", v, PER_METRE)?,
            colours: of_bodies("colours", v, 255.0)?,
            joints,
            topology: Topology::read(&archive, v, fingers.as_deref())?,
            names,
        })
    }

    /// The identity of a body: its name without the outfit.
    pub(crate) fn identity(&self, body: usize) -> &str {
        let name = &self.names[body];
        name.rsplit_once('_')
            .map_or(name.as_str(), |(identity, _)| identity)
    }

    /// Whether each body is of one of `identities`, `[N]`.
    ///
    /// # Errors
    /// If there is no such identity.
    pub(crate) fn of(&self, identities: &[String]) -> Result<Vec<bool>, LearnError> {
        let is = |body: usize, identity: &str| self.identity(body).eq_ignore_ascii_case(identity);
        let all = 0..self.names.len();
        for identity in identities {
            if !all.clone().any(|body| is(body, identity)) {
                return Err(LearnError::Identity(identity.clone()));
            }
        }
        let one_of = |body: usize| identities.iter().any(|identity| is(body, identity));
        Ok(all.map(one_of).collect())
    }

    /// Weights of the bodies, `[N]`, that sum to 1 and are the same for each identity; 0 for those of `without`.
    pub(crate) fn weights_without(&self, without: &[String]) -> Result<Vec<f64>, LearnError> {
        let out = self.of(without)?;
        let outfits = |body: usize| {
            let identity = self.identity(body);
            (0..self.names.len())
                .filter(|other| self.identity(*other) == identity)
                .count()
        };
        let weight = |(body, out): (usize, &bool)| {
            if *out {
                0.0
            } else {
                1.0 / outfits(body) as f64
            }
        };
        let weights: Vec<f64> = out.iter().enumerate().map(weight).collect();
        let sum: f64 = weights.iter().sum();
        Ok(weights
            .iter()
            .map(|weight| weight / sum.max(f64::MIN_POSITIVE))
            .collect())
    }

    /// The mean vertices of bodies with weights, `[V]`, metres.
    pub(crate) fn mean(&self, bodies: &[(usize, f64)]) -> Vec<[f32; 3]> {
        weighted(bodies, &self.vertices)
    }

    /// The mean joints of bodies with weights, `[K]`, metres.
    pub(crate) fn mean_joints(&self, bodies: &[(usize, f64)]) -> Vec<[f32; 3]> {
        weighted(bodies, &self.joints)
    }
}

impl Topology {
    fn read(archive: &Value, v: usize, fingers: Option<&[usize]>) -> Result<Self, ReadError> {
        let f = array(archive, "faces")?.shape.first().copied().unwrap_or(0);
        let weights = shaped(archive, "weight", &[v, 4])?
            .as_chunks::<4>()
            .0
            .iter();
        let weights = weights.map(|row| {
            let sum: f64 = row.iter().sum();
            let allowed = sum > 0.0 && row.iter().all(|weight| *weight >= 0.0);
            let number = row.iter().copied().fold(0.0, f64::min);
            let wrong = ReadError::Number {
                array: "weight",
                number,
            };
            allowed
                .then(|| row.map(|weight| (weight / sum) as f32))
                .ok_or(wrong)
        });
        let faces = whole(archive, "faces", &[f, 3], v)?;
        let bones = whole(archive, "weight_joint", &[v, 4], JOINTS)?;
        let uv = shaped(archive, "uv", &[v, 2])?.as_chunks::<2>().0;
        Ok(Self {
            faces: faces.as_chunks::<3>().0.to_vec(),
            uv: uv
                .iter()
                .map(|row| row.map(|number| number as f32))
                .collect(),
            part: whole(archive, "part", &[v], 3)?
                .iter()
                .map(|part| *part as u8)
                .collect(),
            bones: (bones.as_chunks::<4>().0.iter())
                .map(|row| row.map(|bone| bone as u8))
                .collect(),
            weights: weights.collect::<Result<_, _>>()?,
            finger_weights: match fingers {
                None => None,
                Some(fingers) => {
                    let bones = shaped(archive, "rig_weight_joint", &[v, 4])?;
                    let weights = shaped(archive, "rig_weight", &[v, 4])?;
                    let of_rig = weights_of_rig(fingers, bones, weights);
                    let none = ReadError::Number {
                        array: "rig_weight",
                        number: 0.0,
                    };
                    Some(of_rig.ok_or(none)?)
                }
            },
        })
    }
}

/// Σ weight row, for rows by their index.
fn weighted(weights: &[(usize, f64)], rows: &[Vec<[f32; 3]>]) -> Vec<[f32; 3]> {
    let mut sum = vec![[0f64; 3]; rows.first().map_or(0, Vec::len)];
    for (row, weight) in weights {
        for (sum, number) in sum
            .as_flattened_mut()
            .iter_mut()
            .zip(rows[*row].as_flattened())
        {
            *sum += weight * f64::from(*number);
        }
    }
    sum.iter()
        .map(|row| row.map(|number| number as f32))
        .collect()
}

fn array<'a>(archive: &'a Value, name: &'static str) -> Result<&'a Array, ReadError> {
    match archive.get(name) {
        Some(Value::Array(array)) => Ok(array),
        _ => Err(ReadError::Missing(name)),
    }
}

/// The finite numbers of an array of one shape.
fn shaped<'a>(
    archive: &'a Value,
    name: &'static str,
    shape: &[usize],
) -> Result<&'a [f64], ReadError> {
    let array = array(archive, name)?;
    if array.shape != shape {
        return Err(ReadError::Shape {
            array: name,
            shape: array.shape.clone(),
            expected: format!("{shape:?}"),
        });
    }
    match array.not_finite() {
        Some(at) => Err(ReadError::Number {
            array: name,
            number: array.values[at],
        }),
        None => Ok(&array.values),
    }
}

/// Whole numbers from 0 to below `end`.
fn whole(
    archive: &Value,
    name: &'static str,
    shape: &[usize],
    end: usize,
) -> Result<Vec<u32>, ReadError> {
    let numbers = shaped(archive, name, shape)?;
    let allowed = |number: &f64| number.fract() == 0.0 && (0.0..end as f64).contains(number);
    match numbers.iter().find(|number| !allowed(number)) {
        Some(number) => Err(ReadError::Number {
            array: name,
            number: *number,
        }),
        None => Ok(numbers.iter().map(|number| *number as u32).collect()),
    }
}
