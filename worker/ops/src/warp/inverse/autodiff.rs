//! Gradients of inverse skinning. They flow to weights, transforms, and the fallback of points that are
//! not found.

use super::{InverseOps, WarpGrid};
use crate::autodiff::{Saved, constants, record};
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend};

#[derive(Clone, Debug)]
struct SavedUnpose<B: Backend> {
    weights: FloatTensor<B>,
    transforms: FloatTensor<B>,
    found: FloatTensor<B>,
    grid: WarpGrid,
}

impl<B: InverseOps> Saved<B, 3> for SavedUnpose<B> {
    fn gradients(self, grad: FloatTensor<B>, _: [bool; 3]) -> [FloatTensor<B>; 3] {
        B::unpose_backward(self.weights, self.transforms, self.found, grad, self.grid).into()
    }
}

impl<B: InverseOps, C: CheckpointStrategy> InverseOps for Autodiff<B, C> {
    fn unpose(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        near: FloatTensor<Self>,
        fallback: FloatTensor<Self>,
        grid: WarpGrid,
        steps: usize,
    ) -> FloatTensor<Self> {
        let [points, near] = [points, near].map(|constant| constant.into_primitive());
        record::<B, C, _, _>(
            [weights, transforms, fallback],
            |[weights, transforms, fallback]| {
                let found = B::unpose(
                    weights.clone(),
                    transforms.clone(),
                    points,
                    near,
                    fallback,
                    grid.clone(),
                    steps,
                );
                let saved = SavedUnpose {
                    weights,
                    transforms,
                    found: found.clone(),
                    grid,
                };
                (found, saved)
            },
        )
    }

    fn unpose_backward(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        found: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: WarpGrid,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        constants::<B, C, _, _>(
            [weights, transforms, found, grad],
            |[weights, transforms, found, grad]| {
                B::unpose_backward(weights, transforms, found, grad, grid).into()
            },
        )
        .into()
    }
}
