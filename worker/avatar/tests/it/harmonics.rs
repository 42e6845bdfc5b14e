//! Colours of splats that depend on the view: they are learned, kept, and can be given to a model later.

use crate::support::{options, people, run, tempdir, weights};
use burn::tensor::Device;
use std::sync::Arc;
use yoto_avatar::config::{LearnExposure, ModelConfig, Refine};
use yoto_avatar::evaluate::metrics::psnr;
use yoto_avatar::render::RenderView;
use yoto_avatar::train::{Learn, TrainOptions, TrainPerson, Trainer};
use yoto_capture::ShardBuilder;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::transform::{apply, inverse};

const SIZE: u32 = 64;

fn config(harmonics: usize) -> ModelConfig {
    let mut config = ModelConfig::named("splat", "yoto").expect("a tier");
    let splats = config.appearance.splats_mut().expect("splats");
    splats.count = 2000;
    splats.harmonics = harmonics;
    // As fast as colours, since there are few steps.
    splats.harmonic_rate = splats.colour_rate;
    config.refinement.who = Refine::Never;
    config.exposure.who = LearnExposure::Never;
    config
}

/// A person whose red is the brighter the more the camera sees of their front.
fn shiny() -> TrainPerson {
    let plain = people(&[0], 24, SIZE).remove(0);
    let track = plain.shard.track.clone();
    let skeleton = Skeleton::from_track(&track.skeleton).expect("a skeleton");
    let mut builder = ShardBuilder::new(track.clone());
    for (place, frame) in track.frames.iter().enumerate() {
        let pose = Pose::from_frame(frame).expect("a pose");
        let camera = Camera::from_frame(frame, track.image_size).expect("a camera");
        let body = inverse(&skeleton.body_to_world(&pose));
        let eye = apply(&body, camera.centre());
        let front = eye[2] / eye.iter().map(|v| v * v).sum::<f64>().sqrt();
        let mut image = plain.shard.image(place);
        for pixel in image.rgb.as_chunks_mut::<3>().0 {
            pixel[0] = (f64::from(pixel[0]) * (0.6 + 0.4 * front)).clamp(0.0, 255.0) as u8;
        }
        builder.push(&image).expect("a frame");
    }
    TrainPerson {
        shard: Arc::new(builder.finish().expect("all frames")),
        ..plain
    }
}

/// Frame `place` of the person, as the trained model shows it.
fn shown(trainer: &Trainer, person: &TrainPerson, place: usize) -> Vec<f32> {
    let track = &person.shard.track;
    let frame = &track.frames[place];
    let view = RenderView {
        slot: person.slot,
        pose: Pose::from_frame(frame).expect("a pose"),
        camera: Camera::from_frame(frame, track.image_size).expect("a camera"),
        background: [0.0; 3],
    };
    trainer.renderer().render(&view).expect("renders").rgb
}

fn mean_psnr(trainer: &Trainer, person: &TrainPerson) -> f64 {
    let frames = person.shard.frames();
    let total: f64 = (0..frames)
        .map(|place| {
            let truth = person.shard.image(place);
            let truth: Vec<f32> = truth.rgb.iter().map(|v| f32::from(*v) / 255.0).collect();
            psnr(&shown(trainer, person, place), &truth)
        })
        .sum();
    total / frames as f64
}

#[test]
fn a_colour_that_changes_with_the_view_is_learned() {
    let person = shiny();
    let [plain, first, second] = [0, 1, 2].map(|degree| {
        let people = vec![person.clone()];
        let device = Device::flex();
        let mut trainer =
            Trainer::new(config(degree), options(120), people, &device).expect("starts");
        run(&mut trainer, 120);
        mean_psnr(&trainer, &person)
    });
    for (degree, found) in [(1, first), (2, second)] {
        assert!(
            found > plain + 1.0,
            "{plain:.2} dB without, {found:.2} dB with degree {degree}"
        );
    }
}

#[test]
fn a_model_gains_and_loses_harmonics_when_it_trains_on() {
    let (plain, grown, back) = (tempdir(), tempdir(), tempdir());
    let person = shiny();
    let people = || vec![person.clone()];
    let device = Device::flex();
    let mut trainer = Trainer::new(config(0), options(10), people(), &device).expect("starts");
    run(&mut trainer, 10);
    trainer.save(plain.path()).expect("saves");
    let before = shown(&trainer, &person, 3);
    let on = |degree| TrainOptions {
        harmonics: Some(degree),
        ..options(10)
    };
    let mut trainer = Trainer::resume(plain.path(), on(1), people(), &device).expect("resumes");
    assert!(
        shown(&trainer, &person, 3) == before,
        "zeros change nothing"
    );
    run(&mut trainer, 5);
    trainer.save(grown.path()).expect("saves");
    let after = shown(&trainer, &person, 3);
    let named = |dir: &tempfile::TempDir| weights(dir.path()).remove("splats.0.harmonics");
    assert_eq!(named(&plain), None);
    let learned = named(&grown).expect("harmonics");
    assert_eq!(learned.len(), 4 * 9 * 2000);
    assert!(learned.iter().any(|byte| *byte != 0), "they learn");
    // The second degree keeps the first.
    let trainer = Trainer::resume(grown.path(), on(2), people(), &device).expect("resumes");
    assert!(shown(&trainer, &person, 3) == after);
    trainer.save(back.path()).expect("saves");
    let mut trainer = Trainer::resume(back.path(), on(0), people(), &device).expect("resumes");
    run(&mut trainer, 1);
    trainer.save(back.path()).expect("saves");
    assert_eq!(named(&back), None);
}

#[test]
fn harmonics_are_refused_where_nothing_can_have_them() {
    let (device, dir) = (Device::flex(), tempdir());
    let person = shiny();
    let refused = |config: ModelConfig, degree| {
        let options = TrainOptions {
            harmonics: Some(degree),
            ..options(4)
        };
        let trainer = Trainer::new(config, options, vec![person.clone()], &device);
        trainer.err().expect("refused").to_string()
    };
    let field = ModelConfig::named("draft", "yoto").expect("a tier");
    let error = refused(field, 1);
    assert!(error.contains("the tier draft has a field"), "{error}");
    let error = refused(config(0), 3);
    assert!(error.contains("splats.harmonics"), "{error}");
    let mut trainer =
        Trainer::new(config(0), options(4), vec![person.clone()], &device).expect("starts");
    run(&mut trainer, 1);
    trainer.save(dir.path()).expect("saves");
    let alone = TrainOptions {
        harmonics: Some(1),
        learn: Learn::Own { slot: 0 },
        ..options(4)
    };
    let error = Trainer::resume(dir.path(), alone, vec![person.clone()], &device);
    let error = error.err().expect("refused").to_string();
    assert!(error.contains("a training of one person"), "{error}");
}
