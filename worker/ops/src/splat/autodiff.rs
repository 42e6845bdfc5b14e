//! Gradients of splatting. They flow to everything but the camera.

use super::{SplatOps, View};
use crate::autodiff::{Saved, constants, record};
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend};

#[derive(Clone, Debug)]
struct SavedSplat<B: Backend> {
    transforms: FloatTensor<B>,
    rows: FloatTensor<B>,
    light: FloatTensor<B>,
    picture: FloatTensor<B>,
    view: View,
}

impl<B: SplatOps> Saved<B, 3> for SavedSplat<B> {
    fn gradients(self, grad: FloatTensor<B>, _: [bool; 3]) -> [FloatTensor<B>; 3] {
        let Self {
            transforms,
            rows,
            light,
            picture,
            view,
        } = self;
        B::splat_backward(transforms, rows, light, picture, grad, view).into()
    }
}

impl<B: SplatOps, C: CheckpointStrategy> SplatOps for Autodiff<B, C> {
    fn splat(
        transforms: FloatTensor<Self>,
        rows: FloatTensor<Self>,
        light: FloatTensor<Self>,
        view: View,
    ) -> FloatTensor<Self> {
        record::<B, C, _, _>([transforms, rows, light], |[transforms, rows, light]| {
            let picture = B::splat(
                transforms.clone(),
                rows.clone(),
                light.clone(),
                view.clone(),
            );
            let saved = SavedSplat {
                transforms,
                rows,
                light,
                picture: picture.clone(),
                view,
            };
            (picture, saved)
        })
    }

    fn splat_backward(
        transforms: FloatTensor<Self>,
        rows: FloatTensor<Self>,
        light: FloatTensor<Self>,
        picture: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        view: View,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        constants::<B, C, _, _>(
            [transforms, rows, light, picture, grad],
            |[transforms, rows, light, picture, grad]| {
                B::splat_backward(transforms, rows, light, picture, grad, view).into()
            },
        )
        .into()
    }
}
