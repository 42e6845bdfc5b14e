//! Compositing as an operation of Burn's: on Flex, and in automatic differentiation.

use super::{RaySamples, cpu};
use crate::ops::AvatarOps;
use burn::backend::autodiff::{
    checkpoint::{base::Checkpointer, strategy::CheckpointStrategy},
    grads::Gradients,
    ops::{Backward, Ops, OpsKind},
};
use burn::backend::{Autodiff, Backend, tensor::FloatTensor};
use burn::tensor::TensorData;
use burn_flex::FlexTensor;

/// Gradients to rgb, density and likelihood.
pub(in crate::ops) type Three<B> = (FloatTensor<B>, FloatTensor<B>, FloatTensor<B>);

#[derive(Debug)]
struct CompositeBackward;

impl<B: Backend + AvatarOps> Backward<B, 3> for CompositeBackward {
    type State = (FloatTensor<B>, FloatTensor<B>, FloatTensor<B>, RaySamples);

    fn backward(self, ops: Ops<Self::State, 3>, grads: &mut Gradients, _: &mut Checkpointer) {
        let nodes = ops.parents;
        let grad = grads.consume::<B>(&ops.node);
        let (rgb, density, likelihood, samples) = ops.state;
        let (a, b, c) = B::composite_backward(rgb, density, likelihood, grad, samples);
        for (node, to) in nodes.into_iter().zip([a, b, c]) {
            if let Some(node) = node {
                grads.register::<B>(node.id, to);
            }
        }
    }
}

/// Forward on a differentiating backend.
pub(in crate::ops) fn tracked<B: Backend + AvatarOps, C: CheckpointStrategy>(
    rgb: FloatTensor<Autodiff<B, C>>,
    density: FloatTensor<Autodiff<B, C>>,
    likelihood: FloatTensor<Autodiff<B, C>>,
    samples: RaySamples,
) -> FloatTensor<Autodiff<B, C>> {
    let inputs = [rgb.node(), density.node(), likelihood.node()];
    let (rgb, density, likelihood) = (
        rgb.into_primitive(),
        density.into_primitive(),
        likelihood.into_primitive(),
    );
    match CompositeBackward
        .prepare::<C>(inputs)
        .compute_bound()
        .stateful()
    {
        OpsKind::Tracked(prep) => {
            let output = B::composite(
                rgb.clone(),
                density.clone(),
                likelihood.clone(),
                samples.clone(),
            );
            prep.finish((rgb, density, likelihood, samples), output)
        }
        OpsKind::UnTracked(prep) => prep.finish(B::composite(rgb, density, likelihood, samples)),
    }
}

/// Forward on Flex.
pub(in crate::ops) fn flex(
    rgb: FlexTensor,
    density: FlexTensor,
    likelihood: FlexTensor,
    samples: &RaySamples,
) -> FlexTensor {
    let (rgb, density, likelihood) = (
        rgb.to_contiguous(),
        density.to_contiguous(),
        likelihood.to_contiguous(),
    );
    let output = cpu::forward(
        rgb.storage(),
        density.storage(),
        likelihood.storage(),
        samples,
    );
    FlexTensor::from_data(TensorData::new(output, [samples.rays(), 5]))
}

/// Backward on Flex.
pub(in crate::ops) fn flex_backward(
    rgb: FlexTensor,
    density: FlexTensor,
    likelihood: FlexTensor,
    grad: FlexTensor,
    samples: &RaySamples,
) -> (FlexTensor, FlexTensor, FlexTensor) {
    let (rgb, density) = (rgb.to_contiguous(), density.to_contiguous());
    let (likelihood, grad) = (likelihood.to_contiguous(), grad.to_contiguous());
    let to = cpu::backward(
        rgb.storage(),
        density.storage(),
        likelihood.storage(),
        grad.storage(),
        samples,
    );
    let n = to.density.len();
    (
        FlexTensor::from_data(TensorData::new(to.rgb, [n, 3])),
        FlexTensor::from_data(TensorData::new(to.density, [n])),
        FlexTensor::from_data(TensorData::new(to.likelihood, [n])),
    )
}
