//! Connects the hand-written backward form to Burn's automatic differentiation.

use super::Bands;
use crate::ops::GpuOps;
use burn::backend::{
    Autodiff, Backend,
    autodiff::{
        checkpoint::{base::Checkpointer, strategy::CheckpointStrategy},
        grads::Gradients,
        ops::{Backward, Ops, OpsKind},
    },
    tensor::FloatTensor,
};

#[derive(Debug)]
struct FrequenciesBackward;

impl<B: Backend + GpuOps> Backward<B, 1> for FrequenciesBackward {
    /// The encoded points: a sine's slope is its cosine.
    type State = (FloatTensor<B>, Bands);

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        let [node] = ops.parents;
        let grad = grads.consume::<B>(&ops.node);
        let (encoded, bands) = ops.state;
        if let Some(node) = node {
            let to_points = B::frequencies_backward(encoded, grad, bands);
            grads.register::<B>(node.id, to_points);
        }
    }
}

/// See [`super::frequencies`].
pub fn frequencies<B: Backend + GpuOps, C: CheckpointStrategy>(
    points: FloatTensor<Autodiff<B, C>>,
    bands: Bands,
) -> FloatTensor<Autodiff<B, C>> {
    let nodes = [points.node()];
    let encoded = B::frequencies(points.into_primitive(), bands.clone());
    match FrequenciesBackward
        .prepare::<C>(nodes)
        .compute_bound()
        .stateful()
    {
        OpsKind::Tracked(prep) => prep.finish((encoded.clone(), bands), encoded),
        OpsKind::UnTracked(prep) => prep.finish(encoded),
    }
}
