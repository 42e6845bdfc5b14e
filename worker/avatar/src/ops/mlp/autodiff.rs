//! Connects the hand-written backward form to Burn's automatic differentiation.

use super::MlpPlan;
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
struct MlpBackward;

impl<B: Backend + CpuOps> Backward<B, 2> for MlpBackward {
    type State = (FloatTensor<B>, FloatTensor<B>, MlpPlan);

    fn backward(self, ops: Ops<Self::State, 2>, grads: &mut Gradients, _: &mut Checkpointer) {
        let [params_node, input_node] = ops.parents;
        let grad = grads.consume::<B>(&ops.node);
        let (params, input, plan) = ops.state;
        let (to_params, to_input) =
            B::mlp_backward(params, input, grad, plan, input_node.is_some());
        if let Some(node) = params_node {
            grads.register::<B>(node.id, to_params);
        }
        if let Some(node) = input_node {
            grads.register::<B>(node.id, to_input);
        }
    }
}

/// See [`super::mlp`].
pub fn mlp<B: Backend + CpuOps, C: CheckpointStrategy>(
    params: FloatTensor<Autodiff<B, C>>,
    input: FloatTensor<Autodiff<B, C>>,
    plan: MlpPlan,
) -> FloatTensor<Autodiff<B, C>> {
    let nodes = [params.node(), input.node()];
    let (params, input) = (params.into_primitive(), input.into_primitive());
    match MlpBackward.prepare::<C>(nodes).compute_bound().stateful() {
        OpsKind::Tracked(prep) => {
            let output = B::mlp(params.clone(), input.clone(), plan.clone());
            prep.finish((params, input, plan), output)
        }
        OpsKind::UnTracked(prep) => prep.finish(B::mlp(params, input, plan)),
    }
}
