//! Gradients of forward skinning of a surface. They flow to factors, transforms and points.

use super::{SkinSurfaceOps, WarpGrid};
use crate::autodiff::{Saved, constants, record};
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend};

#[derive(Clone, Debug)]
struct SavedSkinSurface<B: Backend> {
    factors: FloatTensor<B>,
    transforms: FloatTensor<B>,
    points: FloatTensor<B>,
    bones: FloatTensor<B>,
    weights: FloatTensor<B>,
    factored: usize,
    grid: WarpGrid,
}

impl<B: SkinSurfaceOps> Saved<B, 3> for SavedSkinSurface<B> {
    fn gradients(self, grad: FloatTensor<B>, _: [bool; 3]) -> [FloatTensor<B>; 3] {
        B::skin_surface_backward(
            self.factors,
            self.transforms,
            self.points,
            self.bones,
            self.weights,
            grad,
            self.factored,
            self.grid,
        )
        .into()
    }
}

impl<B: SkinSurfaceOps, C: CheckpointStrategy> SkinSurfaceOps for Autodiff<B, C> {
    fn skin_surface(
        factors: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        bones: FloatTensor<Self>,
        weights: FloatTensor<Self>,
        factored: usize,
        grid: WarpGrid,
    ) -> FloatTensor<Self> {
        let [bones, weights] = [bones, weights].map(|constant| constant.into_primitive());
        record::<B, C, _, _>(
            [factors, transforms, points],
            |[factors, transforms, points]| {
                let blended = B::skin_surface(
                    factors.clone(),
                    transforms.clone(),
                    points.clone(),
                    bones.clone(),
                    weights.clone(),
                    factored,
                    grid.clone(),
                );
                let saved = SavedSkinSurface {
                    factors,
                    transforms,
                    points,
                    bones,
                    weights,
                    factored,
                    grid,
                };
                (blended, saved)
            },
        )
    }

    fn skin_surface_backward(
        factors: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        bones: FloatTensor<Self>,
        weights: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        factored: usize,
        grid: WarpGrid,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        constants::<B, C, _, _>(
            [factors, transforms, points, bones, weights, grad],
            |[factors, transforms, points, bones, weights, grad]| {
                B::skin_surface_backward(
                    factors, transforms, points, bones, weights, grad, factored, grid,
                )
                .into()
            },
        )
        .into()
    }
}
