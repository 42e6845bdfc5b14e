//! Properties of training steps: decaying rates, a turn for every person, the person in most
//! patches, gradients of a share of the samples.

use crate::avatar::Avatar;
use crate::config::{ModelConfig, Schedule};
use crate::loss::PatchObjective;
use crate::motion::body::CanonicalBody;
use crate::train::frames::batch::{Batch, Scene, outcome};
use crate::train::frames::patches;
use crate::train::people::{TrainFrame, TrainPerson, TrainSubject};
use crate::train::run::options::{Budget, TrainOptions};
use crate::train::trainer::Trainer;
use burn::module::{Module, ModuleVisitor, Param};
use burn::optim::GradientsParams;
use burn::tensor::{Device, Tensor};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::sync::Arc;
use yoto_capture::ShardBuilder;
use yoto_synthetic::SyntheticPerson;

const SIZE: u32 = 48;
const FRAMES: usize = 4;

fn people(count: usize) -> Vec<TrainPerson> {
    let cast = SyntheticPerson::cast(count, 7);
    let people = cast.iter().enumerate().map(|(slot, person)| {
        let (track, film) = person.capture(FRAMES, SIZE);
        let mut shard = ShardBuilder::new(track);
        for image in &film {
            shard.push(image).expect("a synthetic frame is valid");
        }
        TrainPerson {
            slot,
            name: person.name().into(),
            shard: Arc::new(shard.finish().expect("all frames are there")),
        }
    });
    people.collect()
}

fn config() -> ModelConfig {
    let mut config = ModelConfig::named("draft", "yoto").expect("a tier");
    config.schedule = config.schedule.all_at_once();
    config.schedule.warm_up = 0.0;
    config.optimise.patches = 4;
    config
}

fn trainer(config: ModelConfig, count: usize, steps: u64) -> Trainer {
    let options = TrainOptions {
        budget: Budget::Steps(steps),
        ..TrainOptions::default()
    };
    Trainer::new(config, options, people(count), &Device::flex()).expect("starts")
}

/// Values of parameters or of their gradients, by path; empty where a gradient is absent.
struct Numbers<'a> {
    path: Vec<String>,
    grads: Option<&'a GradientsParams>,
    found: BTreeMap<String, Vec<f32>>,
}

impl ModuleVisitor for Numbers<'_> {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.into());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let tensor = match self.grads {
            Some(grads) => grads.get::<D>(param.id),
            None => Some(param.val().inner()),
        };
        let numbers = tensor.map(|tensor| tensor.try_into_vec_as().expect("f32"));
        self.found
            .insert(self.path.join("."), numbers.unwrap_or_default());
    }
}

fn numbers(avatar: &Avatar, grads: Option<&GradientsParams>) -> BTreeMap<String, Vec<f32>> {
    let mut numbers = Numbers {
        path: Vec::new(),
        grads,
        found: BTreeMap::new(),
    };
    avatar.visit(&mut numbers);
    numbers.found
}

/// Largest change of a value of one parameter.
fn moved(before: &BTreeMap<String, Vec<f32>>, after: &[f32], path: &str) -> f32 {
    let pairs = before[path].iter().zip(after);
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn rates_fall_over_the_run() {
    let mut config = config();
    config.schedule.final_rate = 1e-4;
    let mut trainer = trainer(config, 1, 10);
    let mut step = || {
        let before = numbers(trainer.model.state.avatar(), None);
        trainer.step().expect("a step");
        let after = numbers(trainer.model.state.avatar(), None);
        moved(&before, &after["codes.0"], "codes.0")
    };
    let first = step();
    let last = (1..10).map(|_| step()).last().expect("ten steps");
    // Adam's first step is the rate itself; its last has 0.1^(4 · 0.9) of it.
    assert!(first > 1e-4, "{first:e}");
    assert!(last < 1e-2 * first, "{last:e} after {first:e}");
}

#[test]
fn a_training_that_goes_on_begins_with_lower_rates_if_it_is_short() {
    let trained = |restart| {
        let mut config = config();
        config.schedule.final_rate = 1e-4;
        config.schedule.restart = restart;
        let dir = tempfile::tempdir().expect("a folder");
        let mut first = trainer(config, 1, 8);
        for _ in 0..8 {
            first.step().expect("a step");
        }
        first.save(dir.path()).expect("saves");
        dir
    };
    let (dir, whole) = (trained(0.5), trained(0.0));
    let resume = |dir: &tempfile::TempDir, count: usize, steps: u64, used_steps: u64| {
        let options = TrainOptions {
            budget: Budget::Steps(steps),
            used_steps,
            ..TrainOptions::default()
        };
        let resumed = Trainer::resume(dir.path(), options, people(count), &Device::flex());
        resumed.expect("resumes")
    };
    let step = |trainer: &mut Trainer| {
        let before = numbers(trainer.model.state.avatar(), None);
        trainer.step().expect("a step");
        let after = numbers(trainer.model.state.avatar(), None);
        moved(&before, &after["codes.0"], "codes.0")
    };
    let lower = step(&mut resume(&dir, 1, 4, 0));
    let full = step(&mut resume(&whole, 1, 4, 0));
    assert!(lower < 0.1 * full, "{lower:e} against {full:e}");
    let long = step(&mut resume(&dir, 1, 8, 0));
    assert!(
        (long - full).abs() < 0.1 * full,
        "{long:e} for as long a run"
    );
    assert!(!resume(&dir, 2, 4, 0).run.continues(), "somebody is new");
    // The rest of a budget continues as it began.
    assert!(!resume(&dir, 1, 16, 8).run.continues());
    let mut again = resume(&dir, 1, 4, 0);
    again.step().expect("a step");
    again.save(dir.path()).expect("saves");
    assert!(resume(&dir, 1, 4, 1).run.continues());
}

#[test]
fn an_epoch_teaches_everybody() {
    let mut trainer = trainer(config(), 3, 100);
    let before = numbers(trainer.model.state.avatar(), None);
    for _ in 0..3 * FRAMES {
        trainer.step().expect("a step");
    }
    let after = numbers(trainer.model.state.avatar(), None);
    for slot in 0..3 {
        let code = format!("codes.{slot}");
        assert!(moved(&before, &after[&code], &code) > 0.0, "{code}");
    }
}

/// Patches of `frame` in its given pose.
fn draw(
    subject: &TrainSubject,
    frame: &TrainFrame,
    count: usize,
    size: usize,
    rng: &mut ChaCha8Rng,
) -> Batch {
    let picture = subject.picture(frame);
    let camera = &frame.camera;
    patches::draw(
        &picture,
        camera,
        &frame.pose,
        &subject.body,
        count,
        size,
        rng,
    )
}

#[test]
fn four_patches_in_five_are_centred_on_the_person() {
    let trainer = trainer(config(), 1, 1);
    let subject = &trainer.data.subjects()[0];
    let frame = &subject.frames[1];
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    // Patches of one pixel are their centres; pixels off the person have the background's colour.
    let batch = draw(subject, frame, 4000, 1, &mut rng);
    let background = batch.background;
    let off = batch
        .truth
        .chunks_exact(3)
        .filter(|rgb| **rgb == background);
    let on = 1.0 - off.count() as f64 / 4000.0;
    assert!((on - 0.8).abs() < 0.02, "{on}");
    let outside = batch.rays.iter().filter(|ray| ray.is_none());
    assert_eq!(outside.count(), 0, "and none outside the box");
}

#[test]
fn a_share_of_the_samples_gives_other_gradients_of_the_same_loss() {
    let device = Device::flex().autodiff();
    let with_share = |share: f32| {
        let mut config = config();
        config.optimise.backward_share = share;
        let trainer = trainer(config.clone(), 1, 1);
        let subject = &trainer.data.subjects()[0];
        let frame = &subject.frames[1];
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let batch = draw(subject, frame, 2, 12, &mut rng);
        let avatar = Avatar::new(&config, 1, 24, 3, &device);
        let body = CanonicalBody::new(subject.body.skeleton.clone(), &config, &device);
        let scene = Scene {
            config: &config,
            body: &body,
            slot: 0,
            pose: &frame.pose,
            schedule_progress: 1.0,
            step: 0,
            occupancy: None,
        };
        let objective = PatchObjective::without_lpips(0.0, 12, &device);
        let outcome = outcome(&avatar, &scene, &batch, &objective, Some(&mut rng))
            .expect("a device that works")
            .expect("rays that meet the body");
        let loss: f32 = outcome.loss.clone().into_scalar();
        let grads = GradientsParams::from_grads(outcome.loss.backward(), &avatar);
        (loss, numbers(&avatar, Some(&grads)))
    };
    let (whole, all) = with_share(1.0);
    let (same, some) = with_share(0.1);
    assert_eq!(whole, same, "the forward pass knows nothing of it");
    let differs = |path: &str| all[path] != some[path];
    assert!(differs("canonical.shared") && differs("codes.0"));
}

#[test]
fn a_resting_non_rigid_field_has_no_reach() {
    let mut config = ModelConfig::named("draft", "yoto").expect("a tier");
    config.schedule.non_rigid = Schedule::NEVER;
    config.schedule.all_bands = Schedule::NEVER;
    let mut trainer = trainer(config, 1, 40);
    while !trainer.finished() {
        trainer.step().expect("a step");
    }
    let grid = trainer.model.state.occupancy[0].as_ref().expect("a grid");
    // Searches for canonical points that end elsewhere the second time are no offsets.
    assert_eq!(grid.reach(), 0.0);
}
