//! Gradients of the warp. They flow to the weights and the transforms; the points are where rays
//! were sampled, which is given and not learned.

use super::{WarpGrid, WarpOps};
use crate::autodiff::{Saved, constants, record};
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend};

#[derive(Clone, Debug)]
struct SavedWarp<B: Backend> {
    weights: FloatTensor<B>,
    transforms: FloatTensor<B>,
    points: FloatTensor<B>,
    grid: WarpGrid,
}

impl<B: WarpOps> Saved<B, 2> for SavedWarp<B> {
    fn gradients(self, grad: FloatTensor<B>, _: [bool; 2]) -> [FloatTensor<B>; 2] {
        B::warp_backward(self.weights, self.transforms, self.points, grad, self.grid).into()
    }
}

impl<B: WarpOps, C: CheckpointStrategy> WarpOps for Autodiff<B, C> {
    fn warp(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grid: WarpGrid,
    ) -> FloatTensor<Self> {
        let points = points.into_primitive();
        record::<B, C, _, _>([weights, transforms], |[weights, transforms]| {
            let output = B::warp(
                weights.clone(),
                transforms.clone(),
                points.clone(),
                grid.clone(),
            );
            let saved = SavedWarp {
                weights,
                transforms,
                points,
                grid,
            };
            (output, saved)
        })
    }

    fn warp_backward(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: WarpGrid,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        constants::<B, C, _, _>(
            [weights, transforms, points, grad],
            |[weights, transforms, points, grad]| {
                B::warp_backward(weights, transforms, points, grad, grid).into()
            },
        )
        .into()
    }
}
