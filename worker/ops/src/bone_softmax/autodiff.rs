//! Gradients of the softmax over bones. They flow to the logits; the prior is a constant.

use super::BoneSoftmaxOps;
use crate::autodiff::{Saved, constants, record};
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend};

#[derive(Clone, Debug)]
struct SavedWeights<B: Backend>(FloatTensor<B>);

impl<B: BoneSoftmaxOps> Saved<B, 1> for SavedWeights<B> {
    fn gradients(self, grad: FloatTensor<B>, _: [bool; 1]) -> [FloatTensor<B>; 1] {
        [B::bone_softmax_backward(self.0, grad)]
    }
}

impl<B: BoneSoftmaxOps, C: CheckpointStrategy> BoneSoftmaxOps for Autodiff<B, C> {
    fn bone_softmax(logits: FloatTensor<Self>, log_prior: FloatTensor<Self>) -> FloatTensor<Self> {
        let log_prior = log_prior.into_primitive();
        record::<B, C, _, _>([logits], |[logits]| {
            let weights = B::bone_softmax(logits, log_prior);
            (weights.clone(), SavedWeights(weights))
        })
    }

    fn bone_softmax_backward(
        weights: FloatTensor<Self>,
        grad: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let [to_logits] = constants::<B, C, _, _>([weights, grad], |[weights, grad]| {
            [B::bone_softmax_backward(weights, grad)]
        });
        to_logits
    }
}
