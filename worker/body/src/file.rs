//! The file of a model, and the model that the program has.
//!
//! Safetensors with one tensor per field of [`Body`], small enough to be part of the program: vertices in tenths of a
//! millimetre, components as i16 (the first [`FINE`]) and i8 with a scale each, shares and colours in steps of 1/255.

use crate::body::{Body, JOINTS};
use crate::packed;
use safetensors::tensor::{Dtype, TensorView};
use safetensors::{SafeTensorError, SafeTensors};
use std::collections::HashMap;
use std::sync::OnceLock;
use thiserror::Error;

/// Learned from the VALID avatars without the people on whom models are measured; [`NOTICE`] is its licence.
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
/// Largest difference between 1 and the sum of a joint's shares.
const SHARES_OFF: f32 = 1e-3;

/// Why a file is no model, or a model has no file.
#[derive(Debug, Error)]
pub enum FileError {
    /// Not safetensors, or incomplete.
    #[error("not a body model: {0}")]
    Format(SafeTensorError),
    /// A file of another version, or of something else.
    #[error("not a body model of version {VERSION}: its version is {0}")]
    Version(String),
    /// A tensor is missing.
    #[error("{0}: the tensor is missing")]
    Missing(&'static str),
    /// A tensor of another type or shape.
    #[error("{tensor}: it is {found}, and should be {expected}")]
    Shape {
        /// Its name.
        tensor: &'static str,
        /// Its type and shape.
        found: String,
        /// What they should be.
        expected: String,
    },
    /// A number that is not finite, or that the format can't hold.
    #[error("{0}: a number is not finite or out of range")]
    Number(&'static str),
    /// Shares that are negative or do not sum to 1.
    #[error("{0}: shares are negative or do not sum to 1")]
    Shares(&'static str),
}

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
        let shares = file.floats("joint_shares", &[JOINTS, MOST_SHARES])?;
        let joints = file.indices("joint_vertices", &[JOINTS, MOST_SHARES], v)?;
        let joints: Vec<(u32, f32)> = joints.into_iter().zip(shares).collect();
        let bones = file.get("bones", Dtype::U8, &[v, 4])?;
        if bones.iter().any(|bone| usize::from(*bone) >= JOINTS) {
            return Err(FileError::Number("bones"));
        }
        let weights = file.get("weights", Dtype::U8, &[v, 4])?.as_chunks::<4>().0;
        let whole = |row: &[u8; 4]| row.iter().map(|step| u16::from(*step)).sum::<u16>() == 255;
        if !weights.iter().all(whole) {
            return Err(FileError::Shares("weights"));
        }
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
            joints: joints_of_rows(&joints)?,
            bones: rows(bones),
            weights: weights
                .iter()
                .map(|row| row.map(|step| f32::from(step) / 255.0))
                .collect(),
            mirror: file.indices("mirror", &[v], v)?,
            part: part.to_vec(),
            welded: file.indices("welded", &[v], v)?,
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
        let weights = finite("weights", self.weights.as_flattened())?
            .as_chunks::<4>()
            .0;
        let (joint_vertices, joint_shares) = joint_rows(&self.joints)?;
        let tensors = [
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
            (
                "weights",
                Dtype::U8,
                vec![v, 4],
                weights
                    .iter()
                    .flat_map(|row| packed::pack_shares(*row))
                    .collect(),
            ),
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

/// The tensors of a file.
struct Tensors<'a>(SafeTensors<'a>);

impl<'a> Tensors<'a> {
    fn view(&self, tensor: &'static str) -> Result<TensorView<'a>, FileError> {
        self.0
            .tensor(tensor)
            .map_err(|_| FileError::Missing(tensor))
    }

    /// Extent of the first axis.
    fn count(
        &self,
        tensor: &'static str,
        allowed: std::ops::RangeInclusive<usize>,
    ) -> Result<usize, FileError> {
        let view = self.view(tensor)?;
        let count = view
            .shape()
            .first()
            .copied()
            .filter(|count| allowed.contains(count));
        count.ok_or_else(|| FileError::Shape {
            tensor,
            found: format!("{:?}", view.shape()),
            expected: format!("of {} to {} rows", allowed.start(), allowed.end()),
        })
    }

    fn get(
        &self,
        tensor: &'static str,
        dtype: Dtype,
        shape: &[usize],
    ) -> Result<&'a [u8], FileError> {
        let view = self.view(tensor)?;
        if view.dtype() != dtype || view.shape() != shape {
            return Err(FileError::Shape {
                tensor,
                found: format!("{:?} {:?}", view.dtype(), view.shape()),
                expected: format!("{dtype:?} {shape:?}"),
            });
        }
        Ok(view.data())
    }

    /// Floats that are finite and not negative.
    fn floats(&self, tensor: &'static str, shape: &[usize]) -> Result<Vec<f32>, FileError> {
        let bytes = self.get(tensor, Dtype::F32, shape)?.as_chunks::<4>().0;
        let numbers: Vec<f32> = bytes
            .iter()
            .map(|bytes| f32::from_le_bytes(*bytes))
            .collect();
        let allowed = numbers
            .iter()
            .all(|number| number.is_finite() && *number >= 0.0);
        allowed.then_some(numbers).ok_or(FileError::Number(tensor))
    }

    fn shorts(
        &self,
        tensor: &'static str,
        shape: &[usize],
    ) -> Result<impl Iterator<Item = u16> + use<'a>, FileError> {
        let bytes = self.get(tensor, Dtype::U16, shape)?.as_chunks::<2>().0;
        Ok(bytes.iter().map(|bytes| u16::from_le_bytes(*bytes)))
    }

    /// Indices of vertices, below `vertices`.
    fn indices(
        &self,
        tensor: &'static str,
        shape: &[usize],
        vertices: usize,
    ) -> Result<Vec<u32>, FileError> {
        let indices: Vec<u32> = self.shorts(tensor, shape)?.map(u32::from).collect();
        let inside = indices.iter().all(|index| (*index as usize) < vertices);
        inside.then_some(indices).ok_or(FileError::Number(tensor))
    }
}

/// Numbers as rows of `N`.
fn rows<T: Copy, const N: usize>(numbers: &[T]) -> Vec<[T; N]> {
    numbers.as_chunks::<N>().0.to_vec()
}

/// The regressor in rows of [`MOST_SHARES`] pairs, without the pairs that fill up a row.
fn joints_of_rows(pairs: &[(u32, f32)]) -> Result<Vec<Vec<(u32, f32)>>, FileError> {
    let joint = |row: &[(u32, f32)]| -> Result<Vec<(u32, f32)>, FileError> {
        let sum: f32 = row.iter().map(|(_, share)| share).sum();
        if (sum - 1.0).abs() > SHARES_OFF {
            return Err(FileError::Shares("joint_shares"));
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
fn joint_rows(joints: &[Vec<(u32, f32)>]) -> Result<(Vec<u32>, Vec<f32>), FileError> {
    let mut pairs = Vec::with_capacity(joints.len() * MOST_SHARES);
    for joint in joints {
        if joint.len() > MOST_SHARES {
            return Err(FileError::Shape {
                tensor: "joint_vertices",
                found: format!("{} vertices for a joint", joint.len()),
                expected: format!("at most {MOST_SHARES}"),
            });
        }
        pairs.extend(joint);
        pairs.resize(pairs.len() + MOST_SHARES - joint.len(), (0, 0.0));
    }
    let (vertices, shares): (Vec<u32>, Vec<f32>) = pairs.into_iter().unzip();
    finite("joint_shares", &shares)?;
    Ok((vertices, shares))
}

fn finite<'a>(tensor: &'static str, numbers: &'a [f32]) -> Result<&'a [f32], FileError> {
    let all = numbers.iter().all(|number| number.is_finite());
    all.then_some(numbers).ok_or(FileError::Number(tensor))
}

fn floats(numbers: &[f32]) -> Vec<u8> {
    numbers
        .iter()
        .flat_map(|number| number.to_le_bytes())
        .collect()
}

fn indices(tensor: &'static str, indices: &[u32]) -> Result<Vec<u8>, FileError> {
    let short = |index: &u32| u16::try_from(*index).map_err(|_| FileError::Number(tensor));
    let shorts: Vec<u16> = indices.iter().map(short).collect::<Result<_, _>>()?;
    Ok(shorts
        .iter()
        .flat_map(|index| index.to_le_bytes())
        .collect())
}

/// Numbers from 0 to 1 in 16 bits.
fn units(tensor: &'static str, numbers: &[f32]) -> Result<Vec<u8>, FileError> {
    if !numbers.iter().all(|number| (0.0..=1.0).contains(number)) {
        return Err(FileError::Number(tensor));
    }
    let step = |number: &f32| ((number * f32::from(u16::MAX)).round() as u16).to_le_bytes();
    Ok(numbers.iter().flat_map(step).collect())
}
