//! Trainings of splats: they learn what they are shown, resume where they stopped, and leave earlier people
//! as they were.

mod support;

use burn::tensor::Device;
use support::{options, people, run, tempdir, weights};
use yoto_avatar::config::{ModelConfig, Refine, Setting};
use yoto_avatar::evaluate::metrics::psnr;
use yoto_avatar::render::{RenderView, Rendered, Renderer};
use yoto_avatar::tradeoff::Axes;
use yoto_avatar::train::{Person, Trainer};
use yoto_capture::camera::{Camera, Pose};

const SIZE: u32 = 64;

/// Few splats, for small pictures.
fn config() -> ModelConfig {
    let mut config = ModelConfig::named("splat", "yoto").expect("a tier");
    let splats = config.splats.as_mut().expect("splats");
    splats.count = 2000;
    config
}

fn trainer(slots: &[usize], steps: u64) -> Trainer {
    let people = people(slots, 12, SIZE);
    Trainer::new(config(), options(steps), people, &Device::flex()).expect("starts")
}

/// Frame `place` of a person's capture, as the renderer sees it.
fn shown(renderer: &Renderer, person: &Person, place: usize) -> Rendered {
    let track = &person.shard.track;
    let frame = &track.frames[place];
    let view = RenderView {
        slot: person.slot,
        pose: Pose::from_frame(frame).expect("a pose"),
        camera: Camera::from_frame(frame, track.image_size).expect("a camera"),
        background: [0.0; 3],
    };
    renderer.render(&view).expect("renders")
}

/// Mean PSNR over the capture's frames, dB.
fn mean_psnr(renderer: &Renderer, person: &Person) -> f64 {
    let frames = person.shard.frames();
    let total: f64 = (0..frames)
        .map(|place| {
            let truth = person.shard.image(place);
            let truth: Vec<f32> = truth.rgb.iter().map(|v| f32::from(*v) / 255.0).collect();
            psnr(&shown(renderer, person, place).rgb, &truth)
        })
        .sum();
    total / frames as f64
}

#[test]
fn splats_learn_two_people_from_their_hulls() {
    let people = people(&[0, 1], 12, SIZE);
    let mut trainer = trainer(&[0, 1], 80);
    let before: Vec<f64> = people
        .iter()
        .map(|person| mean_psnr(&trainer.renderer(), person))
        .collect();
    run(&mut trainer, 80);
    for (person, before) in people.iter().zip(before) {
        let after = mean_psnr(&trainer.renderer(), person);
        assert!(
            after > before + 2.0 && after > 25.0,
            "{}: {before:.2} dB at the start, {after:.2} dB after 80 steps",
            person.name
        );
    }
    let progress = trainer.progress();
    assert_eq!(progress.objective, "l1+ssim");
    assert_eq!(progress.samples.rays, 0);
    // Frames cost less at a lower resolution alone.
    let axes = Axes::of(&trainer.renderer());
    assert_eq!((axes.samples.len(), axes.precision.len()), (1, 1));
    assert!(axes.scale.len() > 1);
}

/// The hull starts close to the person: most of what it shows is on the mask, and most of the mask
/// is shown.
#[test]
fn untrained_splats_already_cover_the_person() {
    let person = &people(&[0], 12, SIZE)[0];
    let trainer = trainer(&[0], 1);
    let renderer = trainer.renderer();
    let (mut both, mut either) = (0.0, 0.0);
    for place in 0..person.shard.frames() {
        let frame = shown(&renderer, person, place);
        let mask = person.shard.image(place).mask;
        for (alpha, mask) in frame.alpha.iter().zip(mask) {
            let mask = f32::from(mask) / 255.0;
            both += alpha.min(mask);
            either += alpha.max(mask);
        }
    }
    assert!(
        both / either > 0.7,
        "intersection over union {}",
        both / either
    );
}

#[test]
fn a_resumed_training_of_splats_ends_bit_for_bit_where_an_uninterrupted_one_does() {
    let (stopped, resumed, straight) = (tempdir(), tempdir(), tempdir());
    let mut first = trainer(&[0, 1], 20);
    run(&mut first, 10);
    first.save(stopped.path()).expect("saves");
    run(&mut first, 10);
    first.save(straight.path()).expect("saves");
    let again = yoto_avatar::train::TrainOptions {
        used_steps: 10,
        ..options(20)
    };
    let people = people(&[0, 1], 12, SIZE);
    let mut again =
        Trainer::resume(stopped.path(), again, people, &Device::flex()).expect("resumes");
    run(&mut again, 10);
    again.save(resumed.path()).expect("saves");
    assert!(weights(resumed.path()) == weights(straight.path()));
    assert!(weights(resumed.path()) != weights(stopped.path()));
}

#[test]
fn a_loaded_model_shows_what_the_trained_one_does() {
    let dir = tempdir();
    let mut trainer = trainer(&[0], 5);
    run(&mut trainer, 5);
    trainer.save(dir.path()).expect("saves");
    let loaded = Renderer::load(dir.path(), &Device::flex()).expect("loads");
    let person = &people(&[0], 12, SIZE)[0];
    let (one, other) = (
        shown(&trainer.renderer(), person, 3),
        shown(&loaded, person, 3),
    );
    assert!(one.rgb == other.rgb && one.alpha == other.alpha && one.depth == other.depth);
    // Depth is that of a person two to four metres away where they are opaque.
    let opaque = one
        .alpha
        .iter()
        .zip(&one.depth)
        .filter(|(alpha, _)| **alpha > 0.95);
    let depths: Vec<f32> = opaque.map(|(alpha, depth)| depth / alpha).collect();
    assert!(!depths.is_empty() && depths.iter().all(|d| (1.0..6.0).contains(d)));
}

#[test]
fn somebody_new_starts_from_their_own_hull_and_leaves_the_others_splats_alone() {
    let dir = tempdir();
    let mut first = trainer(&[0], 6);
    run(&mut first, 6);
    first.save(dir.path()).expect("saves");
    let before = weights(dir.path());
    let both = people(&[0, 1], 12, SIZE);
    let joined =
        Trainer::resume(dir.path(), options(6), both.clone(), &Device::flex()).expect("resumes");
    let after = tempdir();
    joined.save(after.path()).expect("saves");
    let after = weights(after.path());
    for (name, bytes) in before
        .iter()
        .filter(|(name, _)| name.starts_with("splats.0."))
    {
        assert!(after[name] == *bytes, "{name} differs");
    }
    assert!(mean_psnr(&joined.renderer(), &both[1]) > 15.0);
}

#[test]
fn what_splats_can_not_do_is_refused_by_name() {
    let refined = yoto_avatar::train::TrainOptions {
        refine_poses: Some(Refine::Always),
        ..options(2)
    };
    let error = Trainer::new(config(), refined, people(&[0], 12, SIZE), &Device::flex());
    let error = error.err().expect("refused").to_string();
    assert!(
        error.starts_with("refinement.who: must be never"),
        "{error}"
    );

    let trainer = trainer(&[0, 1], 1);
    let error = trainer.renderer().with_blend(0, 1, 0.5);
    let error = error.err().expect("refused").to_string();
    assert!(error.contains("between two people of splats"), "{error}");

    let setting = "splats.count=3".parse::<Setting>().expect("a setting");
    let error = config().with(&[setting]).expect_err("refused").to_string();
    assert!(error.starts_with("splats.count: must be 64"), "{error}");

    // Masks without a person.
    let mut nobody = people(&[0], 12, SIZE);
    let shard = std::sync::Arc::make_mut(&mut nobody[0].shard);
    for frame in &mut shard.track.frames {
        // Far to the side of what the camera sees.
        frame.translation[0] += 50.0;
    }
    let error = Trainer::new(config(), options(2), nobody, &Device::flex());
    let error = error.err().expect("refused").to_string();
    assert!(error.contains("poses and masks do not agree"), "{error}");
}
