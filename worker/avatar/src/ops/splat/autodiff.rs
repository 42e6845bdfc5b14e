//! Gradients of splatting. They flow to everything but the camera.

use super::{Sight, SplatOps};
use crate::ops::autodiff::{Saved, constants, record};
use burn::backend::{
    Autodiff, Backend, autodiff::checkpoint::strategy::CheckpointStrategy, tensor::FloatTensor,
};

#[derive(Clone, Debug)]
struct SavedSplat<B: Backend> {
    inputs: [FloatTensor<B>; 7],
    picture: FloatTensor<B>,
    sight: Sight,
}

impl<B: SplatOps> Saved<B, 7> for SavedSplat<B> {
    fn gradients(self, grad: FloatTensor<B>, _: [bool; 7]) -> [FloatTensor<B>; 7] {
        let [transforms, means, turns, scales, opacities, colours, light] = self.inputs;
        B::splat_backward(
            transforms,
            means,
            turns,
            scales,
            opacities,
            colours,
            light,
            self.picture,
            grad,
            self.sight,
        )
        .into()
    }
}

impl<B: SplatOps, C: CheckpointStrategy> SplatOps for Autodiff<B, C> {
    fn splat(
        transforms: FloatTensor<Self>,
        means: FloatTensor<Self>,
        turns: FloatTensor<Self>,
        scales: FloatTensor<Self>,
        opacities: FloatTensor<Self>,
        colours: FloatTensor<Self>,
        light: FloatTensor<Self>,
        sight: Sight,
    ) -> FloatTensor<Self> {
        record::<B, C, _, _>(
            [transforms, means, turns, scales, opacities, colours, light],
            |inputs| {
                let [transforms, means, turns, scales, opacities, colours, light] = inputs.clone();
                let picture = B::splat(
                    transforms,
                    means,
                    turns,
                    scales,
                    opacities,
                    colours,
                    light,
                    sight.clone(),
                );
                let saved = SavedSplat {
                    inputs,
                    picture: picture.clone(),
                    sight,
                };
                (picture, saved)
            },
        )
    }

    fn splat_backward(
        transforms: FloatTensor<Self>,
        means: FloatTensor<Self>,
        turns: FloatTensor<Self>,
        scales: FloatTensor<Self>,
        opacities: FloatTensor<Self>,
        colours: FloatTensor<Self>,
        light: FloatTensor<Self>,
        picture: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        sight: Sight,
    ) -> (
        FloatTensor<Self>,
        FloatTensor<Self>,
        FloatTensor<Self>,
        FloatTensor<Self>,
        FloatTensor<Self>,
        FloatTensor<Self>,
        FloatTensor<Self>,
    ) {
        constants::<B, C, _, _>(
            [
                transforms, means, turns, scales, opacities, colours, light, picture, grad,
            ],
            |[
                transforms,
                means,
                turns,
                scales,
                opacities,
                colours,
                light,
                picture,
                grad,
            ]| {
                B::splat_backward(
                    transforms, means, turns, scales, opacities, colours, light, picture, grad,
                    sight,
                )
                .into()
            },
        )
        .into()
    }
}
