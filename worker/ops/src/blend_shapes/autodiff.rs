//! Gradients of the offsets. They flow to what the joints give and to the weights; the nearness is a constant.

use super::BlendShapesOps;
use crate::autodiff::{Saved, constants, record};
use burn::backend::{
    Autodiff, Backend, autodiff::checkpoint::strategy::CheckpointStrategy, tensor::FloatTensor,
};

#[derive(Clone, Debug)]
struct SavedShapes<B: Backend> {
    near: FloatTensor<B>,
    by_joint: FloatTensor<B>,
    weights: FloatTensor<B>,
}

impl<B: BlendShapesOps> Saved<B, 2> for SavedShapes<B> {
    fn gradients(self, grad: FloatTensor<B>, _: [bool; 2]) -> [FloatTensor<B>; 2] {
        B::blend_shapes_backward(self.near, self.by_joint, self.weights, grad).into()
    }
}

impl<B: BlendShapesOps, C: CheckpointStrategy> BlendShapesOps for Autodiff<B, C> {
    fn blend_shapes(
        near: FloatTensor<Self>,
        by_joint: FloatTensor<Self>,
        weights: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let near = near.into_primitive();
        record::<B, C, _, _>([by_joint, weights], |[by_joint, weights]| {
            let moved = B::blend_shapes(near.clone(), by_joint.clone(), weights.clone());
            let saved = SavedShapes {
                near,
                by_joint,
                weights,
            };
            (moved, saved)
        })
    }

    fn blend_shapes_backward(
        near: FloatTensor<Self>,
        by_joint: FloatTensor<Self>,
        weights: FloatTensor<Self>,
        grad: FloatTensor<Self>,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        let inputs = [near, by_joint, weights, grad];
        constants::<B, C, _, _>(inputs, |[near, by_joint, weights, grad]| {
            B::blend_shapes_backward(near, by_joint, weights, grad).into()
        })
        .into()
    }
}
