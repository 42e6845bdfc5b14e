//! Adam with a learning rate for each part of the model (model.md §8).

use crate::config::OptimiseConfig;
use crate::ops::adam::{AdamRates, update};
use burn::module::ParamGroup;
use burn::optim::{
    AdamState, AdaptiveMomentumState, LearningRate, ModuleOptimizer, Optimizer, RecordState,
    StateSink, StateSource,
};
use burn::tensor::{Device, Tensor};

const BETA_1: f64 = 0.9;
const BETA_2: f64 = 0.999;
/// Burn's default is 1e-5; the paper's is this.
const EPSILON: f64 = 1e-8;

/// Adam whose rate is the step's rate times its own.
#[derive(Clone, Debug)]
struct ScaledAdam {
    scale: f64,
}

/// The state of Burn's Adam, so that Burn saves and loads it, but loaded into CPU memory: Burn
/// would load it on its default device, a GPU as soon as one is compiled in, be it there or
/// not. The next step takes it to its parameter's device either way.
#[derive(Clone)]
struct Moments<const D: usize>(AdamState<D>);

impl<const D: usize> RecordState for Moments<D> {
    fn state_flatten(&self, prefix: &str, out: &mut StateSink) {
        self.0.state_flatten(prefix, out);
    }

    fn state_unflatten(prefix: &str, source: &mut StateSource, _: &Device) -> Option<Self> {
        AdamState::state_unflatten(prefix, source, &Device::flex()).map(Self)
    }
}

impl Optimizer for ScaledAdam {
    type State<const D: usize> = Moments<D>;

    fn step<const D: usize>(
        &self,
        rate: LearningRate,
        tensor: Tensor<D>,
        grad: Tensor<D>,
        state: Option<Self::State<D>>,
    ) -> (Tensor<D>, Option<Self::State<D>>) {
        let (time, moment_1, moment_2) = match state {
            Some(Moments(AdamState { momentum })) => {
                (momentum.time + 1, momentum.moment_1, momentum.moment_2)
            }
            None => (1, tensor.zeros_like(), tensor.zeros_like()),
        };
        let rates = AdamRates::new(rate * self.scale, BETA_1, BETA_2, EPSILON, time);
        let (tensor, moment_1, moment_2) = update(tensor, grad, moment_1, moment_2, rates);
        (
            tensor,
            Some(Moments(AdamState::new(AdaptiveMomentumState::new(
                time, moment_1, moment_2,
            )))),
        )
    }

    fn to_device<const D: usize>(mut state: Self::State<D>, device: &Device) -> Self::State<D> {
        state.0.momentum.moment_1 = state.0.momentum.moment_1.to_device(device);
        state.0.momentum.moment_2 = state.0.momentum.moment_2.to_device(device);
        state
    }
}

/// The optimiser of a model: stepped with a rate that goes from 1 down, each group times its
/// own rate.
pub fn optimiser(config: &OptimiseConfig) -> ModuleOptimizer {
    let group = |path: &str, scale: f64| (ParamGroup::from_predicate(path), ScaledAdam { scale });
    let groups = [
        group("canonical.tables", config.table_rate),
        group("canonical.shared", config.table_rate),
        group("motion.", config.motion_rate),
        group("correction.", config.slow_rate),
        group("condition.", config.slow_rate),
        group("non_rigid.", config.slow_rate),
    ];
    groups.into_iter().fold(
        ModuleOptimizer::from(ScaledAdam { scale: config.rate }),
        |optimiser, (group, adam)| optimiser.with_group(group, adam, None),
    )
}
