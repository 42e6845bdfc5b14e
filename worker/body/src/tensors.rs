//! Tensors of a model's file, each of which must have its type, its shape, and numbers that are allowed.

use safetensors::tensor::{Dtype, TensorView};
use safetensors::{SafeTensorError, SafeTensors};
use std::ops::RangeInclusive;
use thiserror::Error;

/// Why a file is no model, or a model has no file.
#[derive(Debug, Error)]
pub enum FileError {
    /// Not safetensors, or incomplete.
    #[error("not a body model: {0}")]
    Format(SafeTensorError),
    /// A file of another version, or of something else.
    #[error("not a body model of the version that this program reads: its version is {0}")]
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

/// The tensors of a file.
pub(crate) struct Tensors<'a>(pub(crate) SafeTensors<'a>);

impl<'a> Tensors<'a> {
    fn view(&self, tensor: &'static str) -> Result<TensorView<'a>, FileError> {
        self.0
            .tensor(tensor)
            .map_err(|_| FileError::Missing(tensor))
    }

    /// Whether the file has a tensor of this name.
    pub(crate) fn has(&self, tensor: &str) -> bool {
        self.0.tensor(tensor).is_ok()
    }

    /// Extent of the first axis.
    pub(crate) fn count(
        &self,
        tensor: &'static str,
        allowed: RangeInclusive<usize>,
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

    pub(crate) fn get(
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
    pub(crate) fn floats(
        &self,
        tensor: &'static str,
        shape: &[usize],
    ) -> Result<Vec<f32>, FileError> {
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

    pub(crate) fn shorts(
        &self,
        tensor: &'static str,
        shape: &[usize],
    ) -> Result<impl Iterator<Item = u16> + use<'a>, FileError> {
        let bytes = self.get(tensor, Dtype::U16, shape)?.as_chunks::<2>().0;
        Ok(bytes.iter().map(|bytes| u16::from_le_bytes(*bytes)))
    }

    /// Indices of vertices, below `vertices`.
    pub(crate) fn indices(
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
pub(crate) fn rows<T: Copy, const N: usize>(numbers: &[T]) -> Vec<[T; N]> {
    numbers.as_chunks::<N>().0.to_vec()
}

/// The numbers, if all are finite.
pub(crate) fn finite<'a>(tensor: &'static str, numbers: &'a [f32]) -> Result<&'a [f32], FileError> {
    let all = numbers.iter().all(|number| number.is_finite());
    all.then_some(numbers).ok_or(FileError::Number(tensor))
}

/// Floats as bytes.
pub(crate) fn floats(numbers: &[f32]) -> Vec<u8> {
    numbers
        .iter()
        .flat_map(|number| number.to_le_bytes())
        .collect()
}

/// Indices of vertices in 16 bits.
pub(crate) fn indices(tensor: &'static str, indices: &[u32]) -> Result<Vec<u8>, FileError> {
    let short = |index: &u32| u16::try_from(*index).map_err(|_| FileError::Number(tensor));
    let shorts: Vec<u16> = indices.iter().map(short).collect::<Result<_, _>>()?;
    Ok(shorts
        .iter()
        .flat_map(|index| index.to_le_bytes())
        .collect())
}

/// Numbers from 0 to 1 in 16 bits.
pub(crate) fn units(tensor: &'static str, numbers: &[f32]) -> Result<Vec<u8>, FileError> {
    if !numbers.iter().all(|number| (0.0..=1.0).contains(number)) {
        return Err(FileError::Number(tensor));
    }
    let step = |number: &f32| ((number * f32::from(u16::MAX)).round() as u16).to_le_bytes();
    Ok(numbers.iter().flat_map(step).collect())
}
