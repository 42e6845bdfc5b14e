//! Gradients of forward skinning. They flow to weights, transforms and points.

use super::{SkinOps, WarpGrid};
use crate::autodiff::{Saved, constants, record};
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend};

#[derive(Clone, Debug)]
struct SavedSkin<B: Backend> {
    weights: FloatTensor<B>,
    transforms: FloatTensor<B>,
    points: FloatTensor<B>,
    grid: WarpGrid,
}

impl<B: SkinOps> Saved<B, 3> for SavedSkin<B> {
    fn gradients(self, grad: FloatTensor<B>, _: [bool; 3]) -> [FloatTensor<B>; 3] {
        B::skin_backward(self.weights, self.transforms, self.points, grad, self.grid).into()
    }
}

impl<B: SkinOps, C: CheckpointStrategy> SkinOps for Autodiff<B, C> {
    fn skin(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grid: WarpGrid,
    ) -> FloatTensor<Self> {
        record::<B, C, _, _>(
            [weights, transforms, points],
            |[weights, transforms, points]| {
                let blended = B::skin(
                    weights.clone(),
                    transforms.clone(),
                    points.clone(),
                    grid.clone(),
                );
                let saved = SavedSkin {
                    weights,
                    transforms,
                    points,
                    grid,
                };
                (blended, saved)
            },
        )
    }

    fn skin_backward(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: WarpGrid,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        constants::<B, C, _, _>(
            [weights, transforms, points, grad],
            |[weights, transforms, points, grad]| {
                B::skin_backward(weights, transforms, points, grad, grid).into()
            },
        )
        .into()
    }
}
