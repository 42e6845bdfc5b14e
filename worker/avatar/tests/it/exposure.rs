//! Trainings of films whose frames are exposed differently.

use crate::support::{options, run, tempdir};
use burn::tensor::Device;
use std::sync::Arc;
use yoto_avatar::config::{LearnExposure, ModelConfig, Refine};
use yoto_avatar::evaluate::metrics::psnr;
use yoto_avatar::render::{FrameExposure, RenderView};
use yoto_avatar::train::{TrainOptions, TrainPerson, Trainer, capture_exposures};
use yoto_capture::ShardBuilder;
use yoto_capture::camera::{Camera, Pose};
use yoto_synthetic::SyntheticPerson;

const SIZE: u32 = 64;
const FRAMES: usize = 24;
const STEPS: u64 = 240;

fn config() -> ModelConfig {
    let mut config = ModelConfig::named("splat", "yoto").expect("a tier");
    config.appearance.splats_mut().expect("splats").count = 2000;
    config.refinement.who = Refine::Never;
    config
}

/// The gain of a frame: a camera that adjusts itself slowly, and flicker.
fn gain(place: usize, size: f64) -> f64 {
    let slow = (std::f64::consts::TAU * place as f64 / FRAMES as f64 * 3.0).sin();
    let flicker = [0.3, -0.5, 0.1, 0.4, -0.3][place % 5];
    (size * (slow + flicker)).exp()
}

/// A person whose frames have gains of this `size`, of which red has half.
fn film(size: f64) -> TrainPerson {
    let (track, mut images) = SyntheticPerson::cast(1, 7)[0].capture(FRAMES, SIZE);
    let mut shard = ShardBuilder::new(track);
    for (place, image) in images.iter_mut().enumerate() {
        for pixel in image.rgb.chunks_exact_mut(3) {
            for (c, value) in pixel.iter_mut().enumerate() {
                let size = if c == 0 { 0.5 * size } else { size };
                // Darker, so that nothing is clipped.
                *value = (0.6 * gain(place, size) * f64::from(*value)).round() as u8;
            }
        }
        shard.push(image).expect("a frame");
    }
    TrainPerson {
        slot: 0,
        name: "ada".into(),
        shard: Arc::new(shard.finish().expect("a shard")),
    }
}

fn trained(person: &TrainPerson, who: LearnExposure) -> Trainer {
    let options = TrainOptions {
        exposure: Some(who),
        ..options(STEPS)
    };
    let people = vec![person.clone()];
    let mut trainer = Trainer::new(config(), options, people, &Device::flex()).expect("starts");
    run(&mut trainer, STEPS as usize);
    trainer
}

/// Mean PSNR of neutral renders against the frames of `clean`, dB.
fn quality(trainer: &Trainer, clean: &TrainPerson) -> f64 {
    let renderer = trainer.renderer();
    let track = &clean.shard.track;
    let frames = (0..FRAMES).step_by(3);
    let each = frames.map(|place| {
        let frame = &track.frames[place];
        let rendered = renderer.render(&RenderView {
            slot: 0,
            pose: Pose::from_frame(frame).expect("a pose"),
            camera: Camera::from_frame(frame, track.image_size).expect("a camera"),
            background: [0.0; 3],
        });
        let truth = clean.shard.image(place).rgb;
        let truth: Vec<f32> = truth.iter().map(|v| f32::from(*v) / 255.0).collect();
        psnr(&rendered.expect("renders").rgb, &truth)
    });
    let each: Vec<f64> = each.collect();
    each.iter().sum::<f64>() / each.len() as f64
}

#[test]
fn known_gains_are_found_and_renders_are_neutral() {
    let (clean, film) = (film(0.0), film(0.3));
    let learned = trained(&film, LearnExposure::Auto);
    let notes = learned.notes().concat();
    assert!(notes.contains("exposures are learned"), "{notes}");
    let mut squares = 0.0;
    for c in 0..3 {
        let size = if c == 0 { 0.15 } else { 0.3 };
        let mean = (0..FRAMES).map(|place| gain(place, size).ln()).sum::<f64>() / FRAMES as f64;
        for (place, frame) in film.shard.track.frames.iter().enumerate() {
            let found = f64::from(learned.exposure_near(0, frame.index).gain[c]).ln();
            squares += (found - (gain(place, size).ln() - mean)).powi(2);
        }
    }
    let error = (squares / (3 * FRAMES) as f64).sqrt();
    let ignored = trained(&film, LearnExposure::Never);
    let (with, without) = (quality(&learned, &clean), quality(&ignored, &clean));
    assert!(error < 0.06, "gains are off by {:.1} %", 100.0 * error);
    assert!(
        with > without + 0.5,
        "{with:.2} dB, {without:.2} dB without"
    );
    assert_eq!(ignored.exposure_near(0, 3), FrameExposure::NEUTRAL);

    // A checkpoint has them for measurements on the same film.
    let dir = tempdir();
    learned.save(dir.path()).expect("saves");
    let track = &film.shard.track;
    let saved = capture_exposures(dir.path(), 0, track)
        .expect("a file")
        .expect("learned");
    for frame in &track.frames {
        assert_eq!(
            saved.near(frame.index),
            learned.exposure_near(0, frame.index)
        );
    }
    let mut other = track.clone();
    other.frames[0].index += 1000;
    assert_eq!(
        capture_exposures(dir.path(), 0, &other).expect("a file"),
        None
    );
}

#[test]
fn frames_that_are_exposed_alike_are_left_as_they_are() {
    let clean = film(0.0);
    let trainer = trained(&clean, LearnExposure::Auto);
    let notes = trainer.notes().concat();
    assert!(notes.contains("exposed alike"), "{notes}");
    assert_eq!(trainer.exposure_near(0, 5), FrameExposure::NEUTRAL);
}
