//! Connects the hand-written backward form to Burn's automatic differentiation.

use crate::ops::CpuOps;
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
struct DeconvBackward;

impl<B: Backend + CpuOps> Backward<B, 2> for DeconvBackward {
    type State = (FloatTensor<B>, FloatTensor<B>);

    fn backward(self, ops: Ops<Self::State, 2>, grads: &mut Gradients, _: &mut Checkpointer) {
        let [volume_node, kernels_node] = ops.parents;
        let grad = grads.consume::<B>(&ops.node);
        let (volume, kernels) = ops.state;
        let (to_volume, to_kernels) = B::deconv_backward(volume, kernels, grad);
        if let Some(node) = volume_node {
            grads.register::<B>(node.id, to_volume);
        }
        if let Some(node) = kernels_node {
            grads.register::<B>(node.id, to_kernels);
        }
    }
}

/// See [`super::double`].
pub fn double<B: Backend + CpuOps, C: CheckpointStrategy>(
    volume: FloatTensor<Autodiff<B, C>>,
    kernels: FloatTensor<Autodiff<B, C>>,
) -> FloatTensor<Autodiff<B, C>> {
    let nodes = [volume.node(), kernels.node()];
    let (volume, kernels) = (volume.into_primitive(), kernels.into_primitive());
    match DeconvBackward
        .prepare::<C>(nodes)
        .compute_bound()
        .stateful()
    {
        OpsKind::Tracked(prep) => {
            let output = B::deconv(volume.clone(), kernels.clone());
            prep.finish((volume, kernels), output)
        }
        OpsKind::UnTracked(prep) => prep.finish(B::deconv(volume, kernels)),
    }
}
