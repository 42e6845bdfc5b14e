//! Burn's own transposed convolution, which the tests compare the other form with.

use super::{PADDING, STRIDE};
use burn::tensor::Tensor;
use burn::tensor::module::conv_transpose3d;
use burn::tensor::ops::ConvTransposeOptions;

/// See [`super::conv_transpose`].
pub fn conv_transpose(volume: Tensor<4>, kernels: Tensor<5>) -> Tensor<4> {
    let options = ConvTransposeOptions::new([STRIDE; 3], [PADDING; 3], [0; 3], [1; 3], 1);
    conv_transpose3d(volume.unsqueeze(), kernels, None, options).squeeze_dim(0)
}
