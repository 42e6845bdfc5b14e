//! Gradients of the loss. They flow to the picture, and are computed in the forward pass.

use super::{PictureLossOps, Target};
use crate::autodiff::{Saved, constants, record};
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, AutodiffBackend, Backend};

#[derive(Clone, Debug)]
struct SavedGradient<B: Backend>(FloatTensor<B>);

impl<B: PictureLossOps> Saved<B, 1> for SavedGradient<B> {
    fn gradients(self, grad: FloatTensor<B>, _: [bool; 1]) -> [FloatTensor<B>; 1] {
        [B::picture_loss_backward(self.0, grad)]
    }
}

impl<B: PictureLossOps, C: CheckpointStrategy> PictureLossOps for Autodiff<B, C> {
    fn picture_loss(
        picture: FloatTensor<Self>,
        target: Target,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        let mut kept = None;
        let terms = record::<B, C, _, _>([picture], |[picture]| {
            let (terms, gradient) = B::picture_loss(picture, target);
            kept = Some(gradient.clone());
            (terms, SavedGradient(gradient))
        });
        let gradient = kept.expect("record runs the forward pass");
        (
            terms,
            <Autodiff<B, C> as AutodiffBackend>::from_inner(gradient),
        )
    }

    fn picture_loss_backward(
        gradient: FloatTensor<Self>,
        grad: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let [to_picture] = constants::<B, C, _, _>([gradient, grad], |[gradient, grad]| {
            [B::picture_loss_backward(gradient, grad)]
        });
        to_picture
    }
}
