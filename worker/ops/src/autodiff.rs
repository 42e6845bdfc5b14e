//! The part of automatic differentiation that all operations share: their nodes in Burn's graph. Each operation
//! adds what its backward pass needs, and the mathematics.

use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, AutodiffBackend, Backend};
use std::fmt::Debug;
use std::marker::PhantomData;

/// The part of an operation's forward pass that is kept for its backward pass. Gradients flow to `N` of
/// its inputs.
pub(super) trait Saved<B: Backend, const N: usize>: Clone + Debug + Send + 'static {
    /// Gradients to the inputs, in the order in which [`record`] got them, from the gradient to
    /// the result. Where `needed` is false, the value does not matter: it is dropped.
    fn gradients(self, grad: FloatTensor<B>, needed: [bool; N]) -> [FloatTensor<B>; N];
}

/// The step of the backward pass that uses an `S`.
#[derive(Debug)]
struct Step<S>(PhantomData<S>);

impl<B: Backend, S: Saved<B, N>, const N: usize> Backward<B, N> for Step<S> {
    type State = S;

    fn backward(self, ops: Ops<S, N>, grads: &mut Gradients, _: &mut Checkpointer) {
        let grad = grads.consume::<B>(&ops.node);
        let needed = ops.parents.each_ref().map(Option::is_some);
        let gradients = ops.state.gradients(grad, needed);
        for (parent, gradient) in ops.parents.into_iter().zip(gradients) {
            if let Some(parent) = parent {
                grads.register::<B>(parent.id, gradient);
            }
        }
    }
}

/// The result of `forward`, which runs on the plain tensors of `inputs` and also returns what
/// the backward pass needs. That is recorded in the graph if any of the inputs is tracked, and
/// dropped otherwise.
pub(super) fn record<B, C, S, const N: usize>(
    inputs: [FloatTensor<Autodiff<B, C>>; N],
    forward: impl FnOnce([FloatTensor<B>; N]) -> (FloatTensor<B>, S),
) -> FloatTensor<Autodiff<B, C>>
where
    B: Backend,
    C: CheckpointStrategy,
    S: Saved<B, N>,
{
    let nodes = inputs.each_ref().map(|input| input.node());
    let (output, saved) = forward(inputs.map(|input| input.into_primitive()));
    match Step::<S>(PhantomData)
        .prepare::<C>(nodes)
        .compute_bound()
        .stateful()
    {
        OpsKind::Tracked(prep) => prep.finish(saved, output),
        OpsKind::UnTracked(prep) => prep.finish(output),
    }
}

/// The results of `run` on the plain tensors of `inputs`, as constants. Backward passes on a
/// differentiating backend use it, since there are no second derivatives.
pub(super) fn constants<B, C, const I: usize, const O: usize>(
    inputs: [FloatTensor<Autodiff<B, C>>; I],
    run: impl FnOnce([FloatTensor<B>; I]) -> [FloatTensor<B>; O],
) -> [FloatTensor<Autodiff<B, C>>; O]
where
    B: Backend,
    C: CheckpointStrategy,
{
    run(inputs.map(|input| input.into_primitive()))
        .map(<Autodiff<B, C> as AutodiffBackend>::from_inner)
}
