//! Gradients of a network. They flow to the parameters and to the input; those to the input are computed only if
//! they are needed.

use super::{MlpOps, MlpPlan};
use crate::autodiff::{Saved, constants, record};
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend};

#[derive(Clone, Debug)]
struct SavedMlp<B: Backend> {
    params: FloatTensor<B>,
    input: FloatTensor<B>,
    plan: MlpPlan,
}

impl<B: MlpOps> Saved<B, 2> for SavedMlp<B> {
    fn gradients(self, grad: FloatTensor<B>, [_, input]: [bool; 2]) -> [FloatTensor<B>; 2] {
        B::mlp_backward(self.params, self.input, grad, self.plan, input).into()
    }
}

impl<B: MlpOps, C: CheckpointStrategy> MlpOps for Autodiff<B, C> {
    fn mlp(
        params: FloatTensor<Self>,
        input: FloatTensor<Self>,
        plan: MlpPlan,
    ) -> FloatTensor<Self> {
        record::<B, C, _, _>([params, input], |[params, input]| {
            let output = B::mlp(params.clone(), input.clone(), plan.clone());
            let saved = SavedMlp {
                params,
                input,
                plan,
            };
            (output, saved)
        })
    }

    fn mlp_backward(
        params: FloatTensor<Self>,
        input: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        plan: MlpPlan,
        needs_input_grad: bool,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        constants::<B, C, _, _>([params, input, grad], |[params, input, grad]| {
            B::mlp_backward(params, input, grad, plan, needs_input_grad).into()
        })
        .into()
    }
}
