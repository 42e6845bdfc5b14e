//! Shared parts of the `cpu` forms as operations of the Flex backend.

use burn::tensor::TensorData;
use burn_flex::FlexTensor;

/// A tensor of `values`, row by row.
pub(super) fn tensor<const D: usize>(values: Vec<f32>, shape: [usize; D]) -> FlexTensor {
    FlexTensor::from_data(TensorData::new(values, shape))
}
