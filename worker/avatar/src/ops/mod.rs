//! Tensor operations of our own, each in a folder: the pure-tensor `reference`, which runs on
//! every device and which the tests compare with, the `cpu` form, and with the feature `gpu`
//! the `cube` form.
//!
//! The latter two are reached through Burn's backend extension, so that they take part in
//! automatic differentiation like any built-in operation.

pub mod adam;
mod autodiff;
pub mod composite;
#[cfg(feature = "gpu")]
mod cube;
pub mod deconv;
pub mod encode;
mod flex;
pub mod form;
pub mod hash;
pub mod mlp;
pub mod warp;

use burn::backend::{Backend, backend_extension, tensor::FloatTensor};
use burn::tensor::Device;

/// The operations as a backend sees them. Call the wrappers in [`warp`], [`hash`],
/// [`composite`](mod@composite) and [`adam`] instead: they choose the form for the tensor's device.
#[backend_extension(Autodiff, Flex, Cube: cfg(feature = "gpu"), Fusion: cfg(feature = "gpu"))]
pub trait AvatarOps: Backend {
    /// Forward of [`warp::warp`].
    #[fusion(dtype = points, shape = warp::output_shape(points))]
    fn warp(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grid: warp::WarpGrid,
    ) -> FloatTensor<Self>;
    /// Gradients of [`warp::warp`] to the weights and the transforms.
    #[fusion(meta = |weights, transforms, _, _, _| (weights.clone(), transforms.clone()))]
    fn warp_backward(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: warp::WarpGrid,
    ) -> (FloatTensor<Self>, FloatTensor<Self>);
    /// Forward of [`composite::composite`].
    #[fusion(dtype = rgb, shape = composite::output_shape(samples))]
    fn composite(
        rgb: FloatTensor<Self>,
        density: FloatTensor<Self>,
        likelihood: FloatTensor<Self>,
        samples: composite::RaySamples,
    ) -> FloatTensor<Self>;
    /// Gradients of [`composite::composite`] to rgb, density and likelihood.
    #[fusion(meta = |rgb, density, likelihood, _, _| {
        (rgb.clone(), density.clone(), likelihood.clone())
    })]
    fn composite_backward(
        rgb: FloatTensor<Self>,
        density: FloatTensor<Self>,
        likelihood: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        samples: composite::RaySamples,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>);
    /// Forward of [`hash::encode`].
    #[fusion(dtype = points, shape = hash::output_shape(points, grid))]
    fn hash_encode(
        table: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grid: hash::HashGrid,
    ) -> FloatTensor<Self>;
    /// Gradients of [`hash::encode`] to the table and, if `points_too`, the points; else an
    /// empty one in its place.
    #[fusion(meta = |table, points, _, _, points_too| {
        let mut to_points = points.clone();
        to_points.shape = hash::points_gradient_shape(&points.shape, *points_too);
        (table.clone(), to_points)
    })]
    fn hash_encode_backward(
        table: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: hash::HashGrid,
        points_too: bool,
    ) -> (FloatTensor<Self>, FloatTensor<Self>);
    /// One Adam update: parameter, gradient, both moments → parameter, both moments.
    #[fusion(meta = |param, _, moment_1, moment_2, _| {
        (param.clone(), moment_1.clone(), moment_2.clone())
    })]
    fn adam_update(
        param: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        moment_1: FloatTensor<Self>,
        moment_2: FloatTensor<Self>,
        rates: adam::AdamRates,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>);
}

/// The operations that only CPUs have a form of. Call [`mlp::mlp`] and [`deconv::double`] instead.
#[backend_extension(Autodiff, Flex)]
pub trait CpuOps: Backend {
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
    /// Forward of [`deconv::double`].
    fn deconv(volume: FloatTensor<Self>, kernels: FloatTensor<Self>) -> FloatTensor<Self>;
    /// Gradients of [`deconv::double`] to the volume and the kernels.
    fn deconv_backward(
        volume: FloatTensor<Self>,
        kernels: FloatTensor<Self>,
        grad: FloatTensor<Self>,
    ) -> (FloatTensor<Self>, FloatTensor<Self>);
}

/// The operations that only GPUs need a form of. Call [`encode::frequencies`] instead.
#[cfg(feature = "gpu")]
#[backend_extension(Autodiff, Cube, Fusion)]
pub trait GpuOps: Backend {
    /// Forward of [`encode::frequencies`].
    #[fusion(dtype = points, shape = encode::output_shape(points, bands))]
    fn frequencies(points: FloatTensor<Self>, bands: encode::Bands) -> FloatTensor<Self>;
    /// Gradient of [`encode::frequencies`] to the points, from them encoded.
    #[fusion(meta = |encoded, _, bands| {
        let mut to_points = encoded.clone();
        to_points.shape = encode::points_shape(&encoded.shape, bands);
        to_points
    })]
    fn frequencies_backward(
        encoded: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        bands: encode::Bands,
    ) -> FloatTensor<Self>;
}

/// Whether tensors of `device` live in CPU memory, where the `cpu` forms run.
pub fn on_cpu(device: &Device) -> bool {
    use burn::backend::DispatchDevice;
    matches!(
        device.clone().inner().as_dispatch(),
        DispatchDevice::Flex(_)
    )
}

/// Whether the operations have a form of their own for `device`: the `cpu` or the `cube` one.
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
    use burn::backend::DispatchDevice;
    matches!(
        device.clone().inner().as_dispatch(),
        DispatchDevice::Cube(_)
    )
}
