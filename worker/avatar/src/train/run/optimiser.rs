//! Adam with a learning rate for each part of the model: those of the paper and of HumanNeRF
//! (docs/research/paper.md), with additional ones for hash tables and direct motion weights.

use crate::config::{Appearance, ModelConfig};
use burn::module::ParamGroup;
use burn::optim::{
    AdamState, AdaptiveMomentumState, LearningRate, ModuleOptimizer, Optimizer, RecordState,
    StateSink, StateSource,
};
use burn::tensor::{Device, Tensor};
use yoto_ops::adam::{AdamRates, update};

const BETA_1: f64 = 0.9;
const BETA_2: f64 = 0.999;
/// Added to the root of the second moment: PyTorch's default, which HumanNeRF uses. Burn's default
/// is 1e-5.
const EPSILON: f64 = 1e-8;

/// Adam with a factor on the learning rate of each step.
#[derive(Clone, Debug)]
struct ScaledAdam {
    scale: f64,
}

/// The state of Burn's Adam, which Burn saves and loads. It is loaded into CPU memory: Burn would
/// load it on its default device, which is a GPU if GPU support is compiled in, even on machines
/// without one. The next step moves it to the device of its parameter.
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

/// The optimiser of a model. The rate of a step is a factor, from 1 downwards, on the learning
/// rate of each group.
pub fn optimiser(config: &ModelConfig) -> ModuleOptimizer {
    let rates = &config.optimise;
    let group = |path: &str, scale: f64| (ParamGroup::from_predicate(path), ScaledAdam { scale });
    let groups = [
        group("canonical.tables", rates.table_rate),
        group("canonical.shared", rates.table_rate),
        group("motion.", rates.motion_rate),
        group("correction.", rates.slow_rate),
        group("condition.", rates.slow_rate),
        group("non_rigid.", rates.slow_rate),
    ];
    let own = match &config.appearance {
        Appearance::Field(_) => Vec::new(),
        Appearance::Splats(splats) => vec![
            group(".means", splats.mean_rate),
            group(".rotations", splats.rotation_rate),
            group(".scales", splats.scale_rate),
            group(".opacities", splats.opacity_rate),
            group(".colours", splats.colour_rate),
            group(".harmonics", splats.harmonic_rate),
            group(".light", splats.light_rate),
            group("pose_shapes.mlp", splats.pose_shapes.network_rate),
            group("pose_shapes.basis", splats.pose_shapes.rate),
            group("pose_shapes.own", splats.pose_shapes.rate),
        ],
    };
    groups.into_iter().chain(own).fold(
        ModuleOptimizer::from(ScaledAdam { scale: rates.rate }),
        |optimiser, (group, adam)| optimiser.with_group(group, adam, None),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::avatar::Avatar;
    use burn::module::{Module, ModuleVisitor, Param};
    use burn::optim::GradientsParams;
    use std::collections::BTreeMap;

    /// The first number of each parameter.
    #[derive(Default)]
    struct Firsts {
        path: Vec<String>,
        sum: Option<Tensor<1>>,
        found: BTreeMap<String, f64>,
    }

    impl ModuleVisitor for Firsts {
        fn enter_module(&mut self, name: &str, _: &str) {
            self.path.push(name.into());
        }

        fn exit_module(&mut self, _: &str, _: &str) {
            self.path.pop();
        }

        fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
            let numbers: Vec<f32> = param.val().inner().try_into_vec_as().expect("f32");
            self.found
                .insert(self.path.join("."), f64::from(numbers[0]));
            let sum = param.val().sum();
            self.sum = Some(match self.sum.take() {
                Some(total) => total + sum,
                None => sum,
            });
        }
    }

    fn firsts(avatar: &Avatar) -> Firsts {
        let mut firsts = Firsts::default();
        avatar.visit(&mut firsts);
        firsts
    }

    /// Each parameter has the gradient 1, then 3: with Adam's numbers, both steps are known.
    #[test]
    fn every_part_moves_at_its_own_rate_by_the_numbers_of_adam() {
        for tier in ["fast", "splat"] {
            check_rates(&ModelConfig::named(tier, "yoto").expect("a tier"));
        }
        let mut shiny = ModelConfig::named("splat", "yoto").expect("a tier");
        shiny.appearance.splats_mut().expect("splats").harmonics = 2;
        check_rates(&shiny);
    }

    fn check_rates(config: &ModelConfig) {
        let rates = &config.optimise;
        let splats = match &config.appearance {
            Appearance::Splats(splats) => Some(splats),
            Appearance::Field(_) => None,
        };
        let mut avatar = Avatar::new(config, 2, 24, 3, &Device::flex().autodiff());
        let mut optimiser = optimiser(config);
        let (mut first_moment, mut second_moment) = (0.0, 0.0);
        for (time, gradient) in [(1, 1.0f64), (2, 3.0)] {
            let before = firsts(&avatar);
            let loss = before.sum.expect("parameters") * gradient;
            let grads = GradientsParams::from_grads(loss.backward(), &avatar);
            avatar = optimiser.step(1.0, avatar, grads);
            first_moment = 0.9 * first_moment + 0.1 * gradient;
            second_moment = 0.999 * second_moment + 0.001 * gradient * gradient;
            let mean = first_moment / (1.0 - 0.9f64.powi(time));
            let square: f64 = second_moment / (1.0 - 0.999f64.powi(time));
            let unit = mean / (square.sqrt() + 1e-8);
            for (path, after) in firsts(&avatar).found {
                let part = path.split('.').next().expect("a first part");
                let name = path.rsplit('.').next().expect("a last part");
                let rate = match part {
                    "splats" => {
                        let splats = splats.expect("the tier has splats");
                        match name {
                            "means" => splats.mean_rate,
                            "rotations" => splats.rotation_rate,
                            "scales" => splats.scale_rate,
                            "opacities" => splats.opacity_rate,
                            "colours" => splats.colour_rate,
                            "harmonics" => splats.harmonic_rate,
                            "light" => splats.light_rate,
                            _ => panic!("{path} has no rate"),
                        }
                    }
                    "pose_shapes" => {
                        let shapes = &splats.expect("the tier has splats").pose_shapes;
                        match path.split('.').nth(1) {
                            Some("mlp") => shapes.network_rate,
                            Some("basis" | "own") => shapes.rate,
                            Some("pose_ranges") => 0.0,
                            _ => panic!("{path} has no rate"),
                        }
                    }
                    _ if path.starts_with("canonical.tables") => rates.table_rate,
                    _ if path == "canonical.shared" => rates.table_rate,
                    "motion" => rates.motion_rate,
                    "correction" | "condition" | "non_rigid" => rates.slow_rate,
                    "canonical" | "codes" => rates.rate,
                    _ => panic!("{path} has no rate"),
                };
                let expected = before.found[&path] - rate * unit;
                let error = (after - expected).abs();
                assert!(error <= 1e-3 * rate, "{path} at {time}: {after} {expected}");
            }
        }
    }
}
