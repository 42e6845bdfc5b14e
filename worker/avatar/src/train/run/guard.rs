//! Supervision of loss and gradients: steps that are not finite are skipped, and after several in
//! a row the model returns to its last snapshot with a lower rate.

use crate::avatar::Avatar;
use crate::render::occupancy::Occupancy;
use crate::train::exposure::CaptureExposures;
use crate::train::people::TrainFrame;
use crate::train::poses::refinement::PoseRefinement;
use burn::module::{Module, ModuleVisitor, Param};
use burn::optim::{GradientsParams, ModuleOptimizer};
use burn::tensor::Tensor;
use tracing::trace_span;

/// Steps between snapshots.
const KEEP_EVERY: u64 = 200;
/// Number of consecutive bad steps after which the model returns to the snapshot.
const BAD_IN_A_ROW: u32 = 5;
/// Factor on the learning rate at each return.
const RATE_FACTOR: f64 = 0.5;
/// Maximum number of returns.
const MAX_ROLLBACKS: u64 = 8;

/// A model, its optimiser, its occupancy grids, and the factor on its learning rate.
pub(crate) struct TrainState {
    /// `None` only during an update: with a second owner, the optimiser would have to copy every
    /// parameter.
    avatar: Option<Avatar>,
    pub optimiser: ModuleOptimizer,
    /// Occupancy grids by slot. They belong to the weights that they were learned from.
    pub occupancy: Vec<Option<Occupancy>>,
    /// Refined poses by slot; none where poses stay as they are given.
    pub poses: Vec<Option<PoseRefinement>>,
    /// Exposures of each slot's film; none where they are not learned.
    pub exposures: Vec<Option<CaptureExposures>>,
    pub rate_scale: f64,
}

impl TrainState {
    pub(crate) fn new(avatar: Avatar, optimiser: ModuleOptimizer) -> Self {
        Self {
            avatar: Some(avatar),
            optimiser,
            occupancy: Vec::new(),
            poses: Vec::new(),
            exposures: Vec::new(),
            rate_scale: 1.0,
        }
    }

    /// Makes room for people in `slots` slots.
    pub(crate) fn resize(&mut self, slots: usize) {
        self.occupancy.resize(slots, None);
        self.poses.resize(slots, None);
        self.exposures.resize(slots, None);
    }

    /// The model.
    ///
    /// # Panics
    /// If an earlier update panicked.
    pub(crate) fn avatar(&self) -> &Avatar {
        self.avatar
            .as_ref()
            .expect("the model is absent only during an update")
    }

    /// The weight of a `frame` of the person in `slot` in training, 0 to 1.
    pub(crate) fn weight(&self, slot: usize, frame: &TrainFrame) -> f64 {
        let poses = self.poses[slot].as_ref();
        poses.map_or(1.0, |poses| poses.weight(frame.position))
    }

    /// Replaces the model by what `change` makes of it.
    ///
    /// # Panics
    /// If an earlier update panicked.
    pub(crate) fn change_avatar(&mut self, change: impl FnOnce(Avatar) -> Avatar) {
        let avatar = self.avatar.take();
        self.avatar = avatar.map(change);
    }

    /// The model, to change it.
    ///
    /// # Panics
    /// If an earlier update panicked.
    pub(crate) fn avatar_mut(&mut self) -> &mut Avatar {
        self.avatar
            .as_mut()
            .expect("the model is absent only during an update")
    }
}

/// A state to return to.
pub(crate) struct Snapshot {
    avatar: Avatar,
    optimiser: ModuleOptimizer,
    occupancy: Vec<Option<Occupancy>>,
    poses: Vec<Option<PoseRefinement>>,
    exposures: Vec<Option<CaptureExposures>>,
}

impl Snapshot {
    /// A copy of `state`. Tensors are shared until the next step changes them.
    pub(crate) fn of(state: &TrainState) -> Self {
        Self {
            avatar: state.avatar().clone(),
            optimiser: state.optimiser.clone(),
            occupancy: state.occupancy.clone(),
            poses: state.poses.clone(),
            exposures: state.exposures.clone(),
        }
    }

    /// Makes `state` what it was.
    pub(crate) fn restore(&self, state: &mut TrainState) {
        state.avatar = Some(self.avatar.clone());
        state.optimiser = self.optimiser.clone();
        state.occupancy = self.occupancy.clone();
        state.poses = self.poses.clone();
        state.exposures = self.exposures.clone();
    }
}

/// Supervisor of training steps.
pub(crate) struct Guard {
    snapshot: Option<Snapshot>,
    bad: u32,
    pub skipped: u64,
    pub rollbacks: u64,
}

/// Outcome of a step.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    Taken,
    Skipped,
    RolledBack,
    GivenUp,
}

impl Guard {
    pub(crate) fn new(skipped: u64, rollbacks: u64) -> Self {
        Self {
            snapshot: None,
            bad: 0,
            skipped,
            rollbacks,
        }
    }

    /// Takes the step if loss and gradients are finite.
    pub(crate) fn step(
        &mut self,
        state: &mut TrainState,
        loss: f32,
        grads: GradientsParams,
        rate: f64,
        step: u64,
    ) -> Verdict {
        let finite = trace_span!("guard")
            .in_scope(|| loss.is_finite() && gradients_finite(state.avatar(), &grads));
        if finite {
            let _span = trace_span!("update").entered();
            self.bad = 0;
            if step.is_multiple_of(KEEP_EVERY) || self.snapshot.is_none() {
                self.snapshot = Some(Snapshot::of(state));
            }
            let avatar = state
                .avatar
                .take()
                .expect("the model is absent only during an update");
            let rate = rate * state.rate_scale;
            state.avatar = Some(state.optimiser.step(rate, avatar, grads));
            return Verdict::Taken;
        }
        self.skipped += 1;
        self.bad += 1;
        if self.bad < BAD_IN_A_ROW {
            return Verdict::Skipped;
        }
        self.bad = 0;
        self.rollbacks += 1;
        if self.rollbacks > MAX_ROLLBACKS {
            return Verdict::GivenUp;
        }
        // Without a snapshot, no step was taken and the model is unchanged.
        if let Some(snapshot) = &self.snapshot {
            snapshot.restore(state);
        }
        state.rate_scale *= RATE_FACTOR;
        Verdict::RolledBack
    }
}

/// Sum of the magnitudes of all gradients. It stays on the device, so that a step waits for a GPU
/// once and not once per parameter.
struct Magnitude<'a> {
    grads: &'a GradientsParams,
    sum: Option<Tensor<1>>,
}

impl ModuleVisitor for Magnitude<'_> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        if let Some(grad) = self.grads.get::<D>(param.id) {
            let sum = grad.abs().sum();
            self.sum = Some(match self.sum.take() {
                Some(others) => others + sum,
                None => sum,
            });
        }
    }
}

fn gradients_finite(avatar: &Avatar, grads: &GradientsParams) -> bool {
    let mut magnitude = Magnitude { grads, sum: None };
    avatar.visit(&mut magnitude);
    // The sum is finite only if every term is; an overflow of finite terms counts as non-finite.
    magnitude
        .sum
        .is_none_or(|sum| sum.into_scalar::<f32>().is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::ModelConfig;
    use crate::render::occupancy::DensityObservations;
    use crate::train::run::optimiser::optimiser;
    use burn::tensor::Device;

    struct Sum(Option<Tensor<1>>);

    impl ModuleVisitor for Sum {
        fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
            let sum = param.val().sum();
            self.0 = Some(match self.0.take() {
                Some(total) => total + sum,
                None => sum,
            });
        }
    }

    fn total(avatar: &Avatar) -> Tensor<1> {
        let mut sum = Sum(None);
        avatar.visit(&mut sum);
        sum.0.expect("an avatar has parameters")
    }

    fn number(tensor: Tensor<1>) -> f32 {
        tensor.into_scalar()
    }

    #[test]
    fn bad_steps_are_skipped_counted_and_end_in_a_return() {
        let config = ModelConfig::named("draft", "yoto").expect("a tier");
        let avatar = Avatar::new(&config, 1, 4, 3, &Device::flex().autodiff());
        let mut state = TrainState::new(avatar, optimiser(&config));
        let mut guard = Guard::new(0, 0);
        let step = |state: &mut TrainState, guard: &mut Guard, factor: f32, at: u64| {
            let loss = total(state.avatar()) * factor;
            let grads = GradientsParams::from_grads(loss.backward(), state.avatar());
            guard.step(state, 1.0, grads, 1.0, at)
        };
        let start = number(total(state.avatar()));
        let area = yoto_ops::warp::WarpGrid {
            min: [0.0; 3],
            max: [1.0; 3],
            nodes: [2; 3],
            floor: 0.0,
        };
        let grid = Occupancy::new(&area, config.appearance.march().expect("rays"))
            .expect("the tier has grids");
        state.occupancy = vec![Some(grid.clone())];
        assert_eq!(step(&mut state, &mut guard, 1.0, 0), Verdict::Taken);
        assert_eq!(step(&mut state, &mut guard, 1.0, 1), Verdict::Taken);
        let moved = number(total(state.avatar()));
        let mut seen = grid.clone();
        seen.learn(&DensityObservations {
            canonical: vec![0.5; 3],
            moved: vec![0.5; 3],
            densities: vec![0.0],
            likelihoods: vec![1.0],
        });
        assert_ne!(seen, grid);
        state.occupancy = vec![Some(seen)];
        assert!(moved < start);
        for bad in [f32::NAN, f32::INFINITY, f32::NAN, f32::NAN] {
            assert_eq!(step(&mut state, &mut guard, bad, 2), Verdict::Skipped);
            assert_eq!(
                number(total(state.avatar())),
                moved,
                "a skipped step changes nothing"
            );
        }
        assert_eq!(
            step(&mut state, &mut guard, f32::NAN, 2),
            Verdict::RolledBack
        );
        assert_eq!(
            (guard.skipped, guard.rollbacks, state.rate_scale),
            (5, 1, RATE_FACTOR)
        );
        assert_eq!(number(total(state.avatar())), start, "back at the snapshot");
        assert_eq!(state.occupancy, [Some(grid)], "and what was known then");
        assert_eq!(step(&mut state, &mut guard, 1.0, 2), Verdict::Taken);
    }

    #[test]
    fn training_gives_up_after_too_many_returns() {
        let config = ModelConfig::named("draft", "yoto").expect("a tier");
        let avatar = Avatar::new(&config, 1, 4, 3, &Device::flex().autodiff());
        let mut state = TrainState::new(avatar, optimiser(&config));
        let mut guard = Guard::new(0, 0);
        let mut verdicts = (0..1000).map(|step| {
            let grads = total(state.avatar()).backward();
            let grads = GradientsParams::from_grads(grads, state.avatar());
            guard.step(&mut state, f32::NAN, grads, 1.0, step)
        });
        let given_up = verdicts.position(|verdict| verdict == Verdict::GivenUp);
        let expected = (MAX_ROLLBACKS as usize + 1) * BAD_IN_A_ROW as usize - 1;
        assert_eq!(given_up, Some(expected));
    }

    #[test]
    fn a_loss_that_is_not_finite_is_enough() {
        let config = ModelConfig::named("draft", "yoto").expect("a tier");
        let avatar = Avatar::new(&config, 1, 4, 3, &Device::flex().autodiff());
        let mut state = TrainState::new(avatar, optimiser(&config));
        let grads = GradientsParams::from_grads(total(state.avatar()).backward(), state.avatar());
        assert_eq!(
            Guard::new(0, 0).step(&mut state, f32::NAN, grads, 1.0, 0),
            Verdict::Skipped
        );
    }
}
