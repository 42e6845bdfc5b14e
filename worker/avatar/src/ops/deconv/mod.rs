//! A volume grown to twice its resolution: the transposed convolution of the motion decoder, kernel
//! 4³, stride 2, one node of padding. Burn computes its gradient to the kernels as a convolution of
//! as many pictures as there are channels, and hands it over transposed; in two matrix products and
//! an unfolding it is a fraction of that.

pub(super) mod autodiff;
pub mod cpu;
pub(super) mod flex;
pub mod reference;

use super::{CpuOps, on_cpu};
use burn::backend::Dispatch;
use burn::tensor::Tensor;

/// Nodes of a kernel along an axis.
pub const KERNEL: usize = 4;
/// Nodes of a kernel.
pub const NODES: usize = KERNEL.pow(3);
/// Steps between the inputs' places in the output.
pub const STRIDE: usize = 2;
/// Output nodes cut off on each side.
pub const PADDING: usize = 1;

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
