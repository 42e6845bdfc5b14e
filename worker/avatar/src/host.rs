//! Tensors in host memory.

use burn::tensor::Tensor;
use thiserror::Error;

/// A tensor that can't be read from its device.
#[derive(Debug, Error)]
#[error("device: {0}")]
pub struct ReadError(String);

impl ReadError {
    /// The device's message.
    pub(crate) fn into_message(self) -> String {
        self.0
    }
}

/// Values of a tensor, in host memory.
pub(crate) fn read<const D: usize>(tensor: Tensor<D>) -> Result<Vec<f32>, ReadError> {
    tensor
        .try_into_vec_as::<f32>()
        .map_err(|error| ReadError(format!("{error:?}")))
}
