//! Tensor operations that Burn does not have. Each is a folder with the same layout:
//!
//! - `mod.rs`: the function on tensors, which chooses the form for the tensors' device, and the
//!   trait that a backend implements;
//! - `reference.rs`: the operation in Burn's own tensor operations. It runs on every device, and
//!   the tests compare the other forms with it;
//! - `cpu.rs` or `cpu/`: the form for CPU threads, as slices and as an operation of the Flex
//!   backend;
//! - `cube.rs` or `cube/`: the form for GPUs, with the feature `gpu`;
//! - `autodiff.rs`: the backward pass as a part of Burn's automatic differentiation.
//!
//! An operation has only the parts that it needs. Code that they share is beside the folders. Nothing here knows
//! about people: operations take tensors and numbers.
//!
//! In backward passes, a name with `to_` is a gradient of the loss: `to_x` is ∂L/∂x, "the gradient to x".

pub mod adam;
mod autodiff;
pub mod bone_softmax;
pub mod cofactors;
pub mod composite;
#[cfg(feature = "gpu")]
mod cube;
pub mod deconv;
pub mod encode;
pub mod exponential;
mod flex;
pub mod form;
pub mod hash;
pub mod mlp;
pub mod picture_loss;
mod precision;
pub mod splat;
pub mod warp;

pub use precision::Precision;

use burn::backend::DispatchDevice;
use burn::tensor::Device;

/// Whether tensors of `device` live in CPU memory, where the `cpu` forms run.
pub fn on_cpu(device: &Device) -> bool {
    matches!(
        device.clone().inner().as_dispatch(),
        DispatchDevice::Flex(_)
    )
}

/// Whether the operations have a form for `device`, `cpu` or `cube`; otherwise they run the reference.
pub fn has_own_form(device: &Device) -> bool {
    #[cfg(feature = "gpu")]
    if on_gpu(device) {
        return true;
    }
    on_cpu(device)
}

/// Whether tensors of `device` live on a GPU, where the `cube` forms run.
#[cfg(feature = "gpu")]
pub fn on_gpu(device: &Device) -> bool {
    matches!(
        device.clone().inner().as_dispatch(),
        DispatchDevice::Cube(_)
    )
}
