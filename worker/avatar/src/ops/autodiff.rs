//! Connects the operations' hand-written backward forms to Burn's automatic differentiation.

use super::composite::{self, RaySamples};
use super::{AvatarOps, CpuOps, adam::AdamRates, deconv, hash::HashGrid, mlp, warp::WarpGrid};
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
struct WarpBackward;

impl<B: Backend + AvatarOps> Backward<B, 2> for WarpBackward {
    type State = (FloatTensor<B>, FloatTensor<B>, FloatTensor<B>, WarpGrid);

    fn backward(self, ops: Ops<Self::State, 2>, grads: &mut Gradients, _: &mut Checkpointer) {
        let [weights_node, transforms_node] = ops.parents;
        let grad = grads.consume::<B>(&ops.node);
        let (weights, transforms, points, grid) = ops.state;
        let (to_weights, to_transforms) = B::warp_backward(weights, transforms, points, grad, grid);
        if let Some(node) = weights_node {
            grads.register::<B>(node.id, to_weights);
        }
        if let Some(node) = transforms_node {
            grads.register::<B>(node.id, to_transforms);
        }
    }
}

#[derive(Debug)]
struct HashBackward;

impl<B: Backend + AvatarOps> Backward<B, 2> for HashBackward {
    type State = (FloatTensor<B>, FloatTensor<B>, HashGrid);

    fn backward(self, ops: Ops<Self::State, 2>, grads: &mut Gradients, _: &mut Checkpointer) {
        let [table_node, points_node] = ops.parents;
        let grad = grads.consume::<B>(&ops.node);
        let (table, points, grid) = ops.state;
        let (to_table, to_points) =
            B::hash_encode_backward(table, points, grad, grid, points_node.is_some());
        if let Some(node) = table_node {
            grads.register::<B>(node.id, to_table);
        }
        if let Some(node) = points_node {
            grads.register::<B>(node.id, to_points);
        }
    }
}

impl<B: Backend + AvatarOps, C: CheckpointStrategy> AvatarOps for Autodiff<B, C> {
    fn warp(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grid: WarpGrid,
    ) -> FloatTensor<Self> {
        let inputs = [weights.node(), transforms.node()];
        // The points are where rays were sampled: they are given, not learned.
        let (weights, transforms, points) = (
            weights.into_primitive(),
            transforms.into_primitive(),
            points.into_primitive(),
        );
        let run = |w: FloatTensor<B>, t: FloatTensor<B>, p: FloatTensor<B>| {
            B::warp(w, t, p, grid.clone())
        };
        match WarpBackward.prepare::<C>(inputs).compute_bound().stateful() {
            OpsKind::Tracked(prep) => {
                let output = run(weights.clone(), transforms.clone(), points.clone());
                prep.finish((weights, transforms, points, grid), output)
            }
            OpsKind::UnTracked(prep) => prep.finish(run(weights, transforms, points)),
        }
    }

    fn warp_backward(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: WarpGrid,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        let (a, b) = B::warp_backward(
            weights.into_primitive(),
            transforms.into_primitive(),
            points.into_primitive(),
            grad.into_primitive(),
            grid,
        );
        (constant::<B, C>(a), constant::<B, C>(b))
    }

    fn composite(
        rgb: FloatTensor<Self>,
        density: FloatTensor<Self>,
        likelihood: FloatTensor<Self>,
        samples: RaySamples,
    ) -> FloatTensor<Self> {
        composite::tracked::<B, C>(rgb, density, likelihood, samples)
    }

    fn composite_backward(
        rgb: FloatTensor<Self>,
        density: FloatTensor<Self>,
        likelihood: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        samples: RaySamples,
    ) -> composite::Three<Self> {
        let (a, b, c) = B::composite_backward(
            rgb.into_primitive(),
            density.into_primitive(),
            likelihood.into_primitive(),
            grad.into_primitive(),
            samples,
        );
        (
            constant::<B, C>(a),
            constant::<B, C>(b),
            constant::<B, C>(c),
        )
    }

    fn hash_encode(
        table: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grid: HashGrid,
    ) -> FloatTensor<Self> {
        let inputs = [table.node(), points.node()];
        let (table, points) = (table.into_primitive(), points.into_primitive());
        match HashBackward.prepare::<C>(inputs).compute_bound().stateful() {
            OpsKind::Tracked(prep) => {
                let output = B::hash_encode(table.clone(), points.clone(), grid.clone());
                prep.finish((table, points, grid), output)
            }
            OpsKind::UnTracked(prep) => prep.finish(B::hash_encode(table, points, grid)),
        }
    }

    fn hash_encode_backward(
        table: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: HashGrid,
        points_too: bool,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        let (a, b) = B::hash_encode_backward(
            table.into_primitive(),
            points.into_primitive(),
            grad.into_primitive(),
            grid,
            points_too,
        );
        (constant::<B, C>(a), constant::<B, C>(b))
    }

    fn adam_update(
        param: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        moment_1: FloatTensor<Self>,
        moment_2: FloatTensor<Self>,
        rates: AdamRates,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        let (a, b, c) = B::adam_update(
            param.into_primitive(),
            grad.into_primitive(),
            moment_1.into_primitive(),
            moment_2.into_primitive(),
            rates,
        );
        (
            constant::<B, C>(a),
            constant::<B, C>(b),
            constant::<B, C>(c),
        )
    }
}

impl<B: Backend + CpuOps, C: CheckpointStrategy> CpuOps for Autodiff<B, C> {
    fn mlp(
        params: FloatTensor<Self>,
        input: FloatTensor<Self>,
        plan: mlp::MlpPlan,
    ) -> FloatTensor<Self> {
        mlp::autodiff::mlp::<B, C>(params, input, plan)
    }

    fn mlp_backward(
        params: FloatTensor<Self>,
        input: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        plan: mlp::MlpPlan,
        to_input: bool,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        let (a, b) = B::mlp_backward(
            params.into_primitive(),
            input.into_primitive(),
            grad.into_primitive(),
            plan,
            to_input,
        );
        (constant::<B, C>(a), constant::<B, C>(b))
    }

    fn deconv(volume: FloatTensor<Self>, kernels: FloatTensor<Self>) -> FloatTensor<Self> {
        deconv::autodiff::double::<B, C>(volume, kernels)
    }

    fn deconv_backward(
        volume: FloatTensor<Self>,
        kernels: FloatTensor<Self>,
        grad: FloatTensor<Self>,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        let (a, b) = B::deconv_backward(
            volume.into_primitive(),
            kernels.into_primitive(),
            grad.into_primitive(),
        );
        (constant::<B, C>(a), constant::<B, C>(b))
    }
}

#[cfg(feature = "gpu")]
impl<B: Backend + super::GpuOps, C: CheckpointStrategy> super::GpuOps for Autodiff<B, C> {
    fn frequencies(points: FloatTensor<Self>, bands: super::encode::Bands) -> FloatTensor<Self> {
        super::encode::autodiff::frequencies::<B, C>(points, bands)
    }

    fn frequencies_backward(
        encoded: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        bands: super::encode::Bands,
    ) -> FloatTensor<Self> {
        let (encoded, grad) = (encoded.into_primitive(), grad.into_primitive());
        constant::<B, C>(B::frequencies_backward(encoded, grad, bands))
    }
}

/// A result that no gradient flows through: second derivatives are not offered.
fn constant<B: Backend, C: CheckpointStrategy>(
    tensor: FloatTensor<B>,
) -> FloatTensor<Autodiff<B, C>> {
    <Autodiff<B, C> as burn::backend::AutodiffBackend>::from_inner(tensor)
}
