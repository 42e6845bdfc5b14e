//! The complete model at extremes of parameters, poses, masks and rates.

use super::table::{report, values};
use burn::module::{Module, ModuleMapper, Param};
use burn::tensor::{Device, Tensor, TensorData};
use std::sync::Arc;
use yoto_avatar::avatar::{Avatar, AvatarAppearance};
use yoto_avatar::config::ModelConfig;
use yoto_avatar::decoder::Prior;
use yoto_avatar::motion::body::CanonicalBody;
use yoto_avatar::train::{Budget, Learn, TrainOptions, TrainPerson, Trainer, Validation};
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::Skeleton;
use yoto_capture::{FrameImage, Shard, ShardBuilder};
use yoto_synthetic::SyntheticPerson;

/// Multiplies every parameter, or those of one rank (codes and biases are vectors).
struct Scale {
    factor: f32,
    rank: Option<usize>,
}

impl ModuleMapper for Scale {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        if self.rank.is_some_and(|rank| rank != D) {
            return param;
        }
        let factor = self.factor;
        param.map(|tensor| Tensor::from_inner(tensor.inner() * factor).require_grad())
    }
}

fn config() -> ModelConfig {
    let mut config = ModelConfig::named("draft", "yoto").expect("a tier");
    config.schedule = config.schedule.all_at_once();
    config
}

/// Colour, density and likelihood at `points`, and the gradients of all parameters.
fn evaluate(
    config: &ModelConfig,
    avatar: &Avatar,
    pose: &Pose,
    points: Vec<f32>,
) -> (Vec<f32>, Vec<f32>) {
    let device = Device::flex().autodiff();
    let person = &SyntheticPerson::cast(1, 7)[0];
    let skeleton = Skeleton::from_track(&person.skeleton()).expect("a skeleton");
    let body = CanonicalBody::new(skeleton, config, &device);
    let posed = avatar.pose(config, &body, 0, pose, 1.0);
    let n = points.len() / 3;
    let points = Tensor::<2>::from_data(TensorData::new(points, [n, 3]), &device);
    let AvatarAppearance::Field(field) = avatar.appearance(config) else {
        panic!("the tier has a field");
    };
    let (field, _, likelihood) = field.evaluate(&body, &posed, points, None);
    let output = Tensor::cat(
        vec![field.rgb.reshape([3 * n]), field.density, likelihood],
        0,
    );
    let grads = output.clone().sum().backward();
    let mut gradients = Gradients {
        grads: &grads,
        numbers: Vec::new(),
    };
    avatar.visit(&mut gradients);
    (values(output), gradients.numbers)
}

struct Gradients<'a> {
    grads: &'a burn::tensor::Gradients,
    numbers: Vec<f32>,
}

impl burn::module::ModuleVisitor for Gradients<'_> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        if let Some(grad) = param.val().grad(self.grads) {
            self.numbers.extend(values(grad));
        }
    }
}

#[test]
fn parameters_and_poses() {
    let config = config();
    let device = Device::flex().autodiff();
    let fresh = || Avatar::new(&config, 1, 24, 3, &device);
    let points = || vec![0.0f32, 1.0, 0.0, 0.1, 1.2, 0.05, 0.0, 0.5, 0.0];
    let turned = |angle: f32| Pose {
        rotations: vec![[0.6 * angle, -0.8 * angle, 0.0]; 24],
        ..Pose::rest(24)
    };
    let scaled = |factor, rank| fresh().map(&mut Scale { factor, rank });
    let cases = [
        ("as initialised", fresh(), Pose::rest(24), points()),
        (
            "all parameters 0",
            scaled(0.0, None),
            Pose::rest(24),
            points(),
        ),
        (
            "codes and biases 0",
            scaled(0.0, Some(1)),
            Pose::rest(24),
            points(),
        ),
        // A code starts with a norm of about 0.08.
        (
            "codes with a norm of 1e4",
            scaled(1.25e5, Some(1)),
            Pose::rest(24),
            points(),
        ),
        (
            "matrices times 100",
            scaled(100.0, Some(2)),
            Pose::rest(24),
            points(),
        ),
        (
            "every joint turned by π",
            fresh(),
            turned(std::f32::consts::PI),
            points(),
        ),
        (
            "every joint turned by 1e3 rad",
            fresh(),
            turned(1e3),
            points(),
        ),
        (
            "points at 1e4 m",
            fresh(),
            Pose::rest(24),
            vec![1e4, -1e4, 1e4, 0.0, 1e4, 0.0],
        ),
    ];
    for (case, avatar, pose, points) in cases {
        let (output, gradients) = evaluate(&config, &avatar, &pose, points);
        assert!(!gradients.is_empty());
        report("model", case, &output, &gradients, None, 0.0);
    }
}

/// A capture with masks and colours modified by `change`.
fn shard(change: fn(&mut FrameImage)) -> Shard {
    let (track, images) = SyntheticPerson::cast(1, 7)[0].capture(4, 32);
    let mut builder = ShardBuilder::new(track);
    for mut image in images {
        change(&mut image);
        builder.push(&image).expect("a valid frame");
    }
    builder.finish().expect("all frames")
}

#[test]
fn masks_and_rates() {
    type Change = fn(&mut FrameImage);
    let nothing: Change = |_| {};
    let cases: [(&str, Change, f64); 5] = [
        (
            "masks empty",
            |image| (image.mask.fill(0), image.rgb.fill(0)).0,
            1.0,
        ),
        ("masks full", |image| image.mask.fill(255), 1.0),
        (
            "masks of one pixel",
            |image| {
                image.mask.fill(0);
                image.rgb.fill(0);
                image.mask[500] = 255;
            },
            1.0,
        ),
        ("learning rates times 100", nothing, 100.0),
        ("learning rates times 1e6", nothing, 1e6),
    ];
    for (case, change, rate) in cases {
        let mut config = config();
        for group in [
            &mut config.optimise.rate,
            &mut config.optimise.table_rate,
            &mut config.optimise.motion_rate,
            &mut config.optimise.slow_rate,
        ] {
            *group *= rate;
        }
        let options = TrainOptions {
            scratch: None,
            refine_poses: None,
            exposure: None,
            harmonics: None,
            leave_unseen: false,
            prior: Prior::People,
            learn: Learn::Everything,
            budget: Budget::Steps(60),
            used_seconds: 0.0,
            used_steps: 0,
            seed: 5,
            image_size: 0,
            validation: Validation::Every(4),
            lpips: None,
        };
        let person = TrainPerson {
            slot: 0,
            name: "x".into(),
            shard: Arc::new(shard(change)),
        };
        let mut trainer =
            Trainer::new(config, options, vec![person], &Device::flex()).expect("starts");
        for _ in 0..60 {
            trainer.step().expect("a step");
        }
        trainer.validate().expect("renders");
        let progress = trainer.progress();
        let psnr = progress.psnr.expect("a held-out frame");
        let numbers = [progress.loss as f32, psnr.min(99.0) as f32];
        let case = format!(
            "{case}: 60 steps, {} skipped, {} returns",
            progress.skipped_steps, progress.rollbacks
        );
        report("training", &case, &numbers, &[], None, 0.0);
    }
}
