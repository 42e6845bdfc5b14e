//! A volume grown to twice its resolution: the transposed convolution of the motion decoder, kernel
//! 4³, stride 2, one node of padding. Burn computes its gradient to the kernels as a convolution
//! over as many images as there are channels, and returns it transposed; two matrix products and an
//! unfolding take a fraction of that time.

mod autodiff;
pub mod cpu;
pub mod reference;

use super::on_cpu;
use burn::backend::{Backend, Dispatch, backend_extension, tensor::FloatTensor};
use burn::tensor::Tensor;

/// Nodes of a kernel per axis.
pub const KERNEL: usize = 4;
/// Nodes of a kernel.
pub const NODES: usize = KERNEL.pow(3);
/// Distance in the output between neighbouring voxels of the input.
pub const STRIDE: usize = 2;
/// Output nodes cut off on each side.
pub const PADDING: usize = 1;

/// The transposed convolution as a backend implements it; other devices have the reference. Call
/// [`double`] instead.
#[backend_extension(Autodiff, Flex)]
pub trait DeconvOps: Backend {
    /// Forward of [`double`].
    fn deconv(volume: FloatTensor<Self>, kernels: FloatTensor<Self>) -> FloatTensor<Self>;
    /// Gradients of [`double`] to the volume and the kernels, from `grad` `[O, 2D, 2D, 2D]`.
    fn deconv_backward(
        volume: FloatTensor<Self>,
        kernels: FloatTensor<Self>,
        grad: FloatTensor<Self>,
    ) -> (FloatTensor<Self>, FloatTensor<Self>);
}

/// `volume` `[I, D, D, D]` and `kernels` `[I, O, 4, 4, 4]` → `[O, 2D, 2D, 2D]`. Gradients flow to
/// both.
pub fn double(volume: Tensor<4>, kernels: Tensor<5>) -> Tensor<4> {
    if on_cpu(&volume.device()) {
        Tensor::from_dispatch(Dispatch::deconv(
            volume.into_dispatch(),
            kernels.into_dispatch(),
        ))
    } else {
        reference::double(volume, kernels)
    }
}
