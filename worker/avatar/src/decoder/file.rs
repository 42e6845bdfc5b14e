//! The file of a decoder, and the decoder that the program has.

use super::cells::CELLS;
use super::linear::Decoder;
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};
use std::collections::HashMap;
use std::sync::OnceLock;
use thiserror::Error;

/// Learned from 32 of the VALID avatars; its licence is beside it (docs/research/splats.md, "What people share").
static PEOPLE: &[u8] = include_bytes!("people.safetensors");
/// Most numbers of a code.
const MOST: usize = 512;

/// A file that is no decoder.
#[derive(Debug, Error)]
pub enum FileError {
    /// Not safetensors, or a tensor is missing.
    #[error("not a decoder: {0}")]
    Format(String),
    /// A tensor of another shape.
    #[error("{tensor}: its shape is {shape:?}, and a decoder's is {expected}")]
    Shape {
        /// Its name.
        tensor: &'static str,
        /// Its shape.
        shape: Vec<usize>,
        /// What it should be.
        expected: String,
    },
    /// A number that is not finite.
    #[error("{0}: a number is not finite")]
    Number(&'static str),
}

impl Decoder {
    /// The decoder that the program has.
    ///
    /// # Panics
    /// Never: a test reads the file.
    pub fn people() -> &'static Self {
        static DECODER: OnceLock<Decoder> = OnceLock::new();
        DECODER.get_or_init(|| {
            Self::from_bytes(PEOPLE).expect("a test reads the file that the program is built with")
        })
    }

    /// Reads a decoder's file.
    ///
    /// # Errors
    /// If the bytes are not a decoder's file.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, FileError> {
        let format = |error: safetensors::SafeTensorError| FileError::Format(error.to_string());
        let file = SafeTensors::deserialize(bytes).map_err(format)?;
        let mean = file.tensor("mean").map_err(format)?;
        let basis = file.tensor("basis").map_err(format)?;
        let rank = basis.shape().first().copied().unwrap_or(0);
        let mean = numbers("mean", &mean, &[CELLS, 3])?;
        if !(1..=MOST).contains(&rank) {
            return Err(FileError::Shape {
                tensor: "basis",
                shape: basis.shape().to_vec(),
                expected: format!("[1 to {MOST}, {CELLS}, 3]"),
            });
        }
        let basis = numbers("basis", &basis, &[rank, CELLS, 3])?;
        Ok(Self {
            mean,
            basis: basis.chunks_exact(CELLS).map(<[_]>::to_vec).collect(),
        })
    }

    /// The file of this decoder, which says where it is from.
    ///
    /// # Errors
    /// Never, for decoders of this program.
    pub fn to_bytes(&self, notes: &[(&str, &str)]) -> Result<Vec<u8>, FileError> {
        let bytes = |colours: &[[f32; 3]]| -> Vec<u8> {
            let numbers = colours.as_flattened().iter();
            numbers.flat_map(|number| number.to_le_bytes()).collect()
        };
        let (mean, basis) = (bytes(&self.mean), bytes(&self.basis.concat()));
        let failed = |error: safetensors::SafeTensorError| FileError::Format(error.to_string());
        let rank = self.basis.len();
        let tensors = [
            ("mean", TensorView::new(Dtype::F32, vec![CELLS, 3], &mean)),
            (
                "basis",
                TensorView::new(Dtype::F32, vec![rank, CELLS, 3], &basis),
            ),
        ];
        let tensors = tensors.map(|(name, view)| Ok((name, view.map_err(failed)?)));
        let tensors = tensors.into_iter().collect::<Result<Vec<_>, FileError>>()?;
        let notes = notes
            .iter()
            .map(|(name, text)| (name.to_string(), text.to_string()));
        let notes: HashMap<String, String> = notes.collect();
        safetensors::serialize(tensors, Some(notes)).map_err(failed)
    }
}

/// The colours of a tensor of the `shape` `[…, 3]`.
fn numbers(
    tensor: &'static str,
    view: &TensorView<'_>,
    shape: &[usize],
) -> Result<Vec<[f32; 3]>, FileError> {
    if view.dtype() != Dtype::F32 || view.shape() != shape {
        return Err(FileError::Shape {
            tensor,
            shape: view.shape().to_vec(),
            expected: format!("{shape:?} of F32"),
        });
    }
    let numbers: Vec<f32> = (view.data().as_chunks::<4>().0.iter())
        .map(|bytes| f32::from_le_bytes(*bytes))
        .collect();
    if numbers.iter().any(|number| !number.is_finite()) {
        return Err(FileError::Number(tensor));
    }
    Ok(numbers.as_chunks::<3>().0.to_vec())
}
