//! The transposed convolution of the motion decoder, which doubles the resolution of a volume: kernel 4³, stride 2,
//! padding 1. Burn computes its gradient to the kernels as a convolution with a batch of one image per channel, and
//! returns it transposed; two matrix products and an unfolding (im2col) take a fraction of that time.

mod autodiff;
pub mod cpu;
pub mod reference;

use super::on_cpu;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, backend_extension};
use burn::tensor::Tensor;

/// Kernel size per axis, nodes.
pub const KERNEL: usize = 4;
/// Nodes of a kernel in total.
pub const NODES: usize = KERNEL.pow(3);
/// Stride: distance in the output between neighbouring voxels of the input.
pub const STRIDE: usize = 2;
/// Padding: output nodes cut off on each side.
pub const PADDING: usize = 1;

/// The transposed convolution as a backend implements it; other devices run the reference. Call
/// [`conv_transpose`] instead.
#[backend_extension(Autodiff, Flex)]
pub trait DeconvOps: Backend {
    /// Forward of [`conv_transpose`].
    fn deconv(volume: FloatTensor<Self>, kernels: FloatTensor<Self>) -> FloatTensor<Self>;
    /// Gradients of [`conv_transpose`] to the volume and the kernels, from `grad` `[O, 2D, 2D, 2D]`.
    fn deconv_backward(
        volume: FloatTensor<Self>,
        kernels: FloatTensor<Self>,
        grad: FloatTensor<Self>,
    ) -> (FloatTensor<Self>, FloatTensor<Self>);
}

/// `volume` `[I, D, D, D]` and `kernels` `[I, O, 4, 4, 4]` → `[O, 2D, 2D, 2D]`. Gradients flow to
/// both.
pub fn conv_transpose(volume: Tensor<4>, kernels: Tensor<5>) -> Tensor<4> {
    if on_cpu(&volume.device()) {
        Tensor::from_dispatch(Dispatch::deconv(
            volume.into_dispatch(),
            kernels.into_dispatch(),
        ))
    } else {
        reference::conv_transpose(volume, kernels)
    }
}
