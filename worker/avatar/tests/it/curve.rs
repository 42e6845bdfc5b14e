//! What a held-out frame measures over a run: it may rise slowly, but training throws nothing away.

use crate::support::options;
use burn::tensor::Device;
use std::sync::Arc;
use yoto_avatar::config::{ModelConfig, Refine};
use yoto_avatar::train::{TrainOptions, TrainPerson, Trainer, Validation};
use yoto_capture::ShardBuilder;
use yoto_synthetic::{Estimator, SyntheticPerson};

/// Side of the pictures, pixels.
const SIZE: u32 = 64;
/// Validations of a run, as a service makes them.
const VALIDATIONS: u64 = 8;
/// Most that a validation may measure below an earlier one, dB: a few frames move against others, most when splats
/// have just been split.
const NOISE: f64 = 0.6;
/// Most that the end may measure below the highest, dB.
const END: f64 = 0.1;

/// A film of a person whose poses an estimator found.
fn film(frames: usize) -> TrainPerson {
    let (track, images) = SyntheticPerson::cast(1, 7)[0].capture(frames, SIZE);
    let estimator = Estimator {
        mistakes: 0.0,
        ..Estimator::default()
    };
    let track = estimator.estimate(&track, 1).expect("an estimate").track;
    let mut shard = ShardBuilder::new(track);
    for image in &images {
        shard.push(image).expect("a frame");
    }
    TrainPerson {
        slot: 0,
        name: "ada".into(),
        shard: Arc::new(shard.finish().expect("a shard")),
    }
}

/// The PSNR in the box that each validation of a run measures, dB; the last one is after the best state is kept.
fn curve(frames: usize, steps: u64, refine: Refine) -> Vec<f64> {
    let mut config = ModelConfig::named("splat", "yoto").expect("a tier");
    let splats = config.appearance.splats_mut().expect("splats");
    (splats.count, splats.coarse) = (3000, 600);
    config.refinement.who = refine;
    let options = TrainOptions {
        validation: Validation::Every(6),
        ..options(steps)
    };
    let people = vec![film(frames)];
    let mut trainer = Trainer::new(config, options, people, &Device::flex()).expect("starts");
    let mut curve = Vec::new();
    for step in 1..=steps {
        trainer.step().expect("a step");
        if step * VALIDATIONS / steps > (step - 1) * VALIDATIONS / steps {
            trainer.validate().expect("measures");
            curve.push(
                trainer
                    .progress()
                    .psnr_mask_box
                    .expect("frames are held out"),
            );
        }
    }
    trainer.keep_best(&mut || {}).expect("keeps");
    curve.push(
        trainer
            .progress()
            .psnr_mask_box
            .expect("frames are held out"),
    );
    println!("{frames} frames, {steps} steps, {refine:?}: {curve:.2?}");
    curve
}

#[test]
fn no_budget_and_no_film_ends_lower_than_it_was() {
    for (frames, steps) in [(18, 48), (18, 320), (60, 160)] {
        for refine in [Refine::Never, Refine::Always] {
            let curve = curve(frames, steps, refine);
            let mut highest = f64::MIN;
            for psnr in &curve {
                assert!(
                    *psnr > highest - NOISE,
                    "{frames}, {steps}, {refine:?}: {curve:.2?}"
                );
                highest = highest.max(*psnr);
            }
            assert!(
                curve.last().is_some_and(|end| *end >= highest - END),
                "{frames}, {steps}, {refine:?}: {curve:.2?}"
            );
        }
    }
}
