//! The operations on GPUs: unwraps the tensors of Burn's CubeCL backend for the `cube` forms,
//! which one source compiles for Vulkan, CUDA and HIP alike.

pub(in crate::ops) mod adding;
pub(in crate::ops) mod tensors;

use super::{AvatarOps, GpuOps, adam, composite, encode, hash, warp};
use burn::backend::tensor::FloatTensor;
use burn_cubecl::CubeBackend;

impl AvatarOps for CubeBackend {
    fn warp(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grid: warp::WarpGrid,
    ) -> FloatTensor<Self> {
        warp::cube::forward(weights, transforms, points, &grid)
    }

    fn warp_backward(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: warp::WarpGrid,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        warp::cube::backward(weights, transforms, points, grad, &grid)
    }

    fn composite(
        rgb: FloatTensor<Self>,
        density: FloatTensor<Self>,
        likelihood: FloatTensor<Self>,
        samples: composite::RaySamples,
    ) -> FloatTensor<Self> {
        composite::cube::forward(rgb, density, likelihood, &samples)
    }

    fn composite_backward(
        rgb: FloatTensor<Self>,
        density: FloatTensor<Self>,
        likelihood: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        samples: composite::RaySamples,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        composite::cube::backward(rgb, density, likelihood, grad, &samples)
    }

    fn hash_encode(
        table: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grid: hash::HashGrid,
    ) -> FloatTensor<Self> {
        hash::cube::forward(table, points, &grid)
    }

    fn hash_encode_backward(
        table: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: hash::HashGrid,
        points_too: bool,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        hash::cube::backward(table, points, grad, &grid, points_too)
    }

    fn adam_update(
        param: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        moment_1: FloatTensor<Self>,
        moment_2: FloatTensor<Self>,
        rates: adam::AdamRates,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        adam::cube::update(param, grad, moment_1, moment_2, rates)
    }
}

impl GpuOps for CubeBackend {
    fn frequencies(points: FloatTensor<Self>, bands: encode::Bands) -> FloatTensor<Self> {
        encode::cube::forward(points, &bands)
    }

    fn frequencies_backward(
        encoded: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        bands: encode::Bands,
    ) -> FloatTensor<Self> {
        encode::cube::backward(encoded, grad, &bands)
    }
}
