//! Tensor operations of our own, each in a folder: the pure-tensor `reference`, which runs on
//! every device and which the tests compare with, and the `cpu` form.
//!
//! The CPU form is reached through Burn's backend extension, so that it takes part in
//! automatic differentiation like any built-in operation.

pub mod adam;
mod autodiff;
pub mod composite;
mod flex;
pub mod form;
pub mod hash;
pub mod mlp;
pub mod warp;

use burn::backend::{Backend, backend_extension, tensor::FloatTensor};
use burn::tensor::Device;

/// The operations as a backend sees them. Call the wrappers in [`warp`], [`hash`], [`mlp`],
/// [`composite`](mod@composite) and [`adam`] instead: they choose the form for the tensor's device.
#[backend_extension(Autodiff, Flex)]
pub trait AvatarOps: Backend {
    /// Forward of [`warp::warp`].
    fn warp(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grid: warp::WarpGrid,
    ) -> FloatTensor<Self>;
    /// Gradients of [`warp::warp`] to the weights and the transforms.
    fn warp_backward(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: warp::WarpGrid,
    ) -> (FloatTensor<Self>, FloatTensor<Self>);
    /// Forward of [`composite::composite`].
    fn composite(
        rgb: FloatTensor<Self>,
        density: FloatTensor<Self>,
        likelihood: FloatTensor<Self>,
        samples: composite::RaySamples,
    ) -> FloatTensor<Self>;
    /// Gradients of [`composite::composite`] to rgb, density and likelihood.
    fn composite_backward(
        rgb: FloatTensor<Self>,
        density: FloatTensor<Self>,
        likelihood: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        samples: composite::RaySamples,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>);
    /// Forward of [`hash::encode`].
    fn hash_encode(
        table: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grid: hash::HashGrid,
    ) -> FloatTensor<Self>;
    /// Gradients of [`hash::encode`] to the table and, if `points_too`, the points; else an
    /// empty one in its place.
    fn hash_encode_backward(
        table: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: hash::HashGrid,
        points_too: bool,
    ) -> (FloatTensor<Self>, FloatTensor<Self>);
    /// One Adam update: parameter, gradient, both moments → parameter, both moments.
    fn adam_update(
        param: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        moment_1: FloatTensor<Self>,
        moment_2: FloatTensor<Self>,
        rates: adam::AdamRates,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>);
    /// Forward of [`mlp::mlp`].
    fn mlp(
        params: FloatTensor<Self>,
        input: FloatTensor<Self>,
        plan: mlp::MlpPlan,
    ) -> FloatTensor<Self>;
    /// Gradients of [`mlp::mlp`] to the parameters and the input; the latter has no rows
    /// unless `to_input`.
    fn mlp_backward(
        params: FloatTensor<Self>,
        input: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        plan: mlp::MlpPlan,
        to_input: bool,
    ) -> (FloatTensor<Self>, FloatTensor<Self>);
}

/// Whether tensors of `device` live in CPU memory, where the `cpu` forms run.
pub fn on_cpu(device: &Device) -> bool {
    use burn::backend::DispatchDevice;
    matches!(
        device.clone().inner().as_dispatch(),
        DispatchDevice::Flex(_)
    )
}
