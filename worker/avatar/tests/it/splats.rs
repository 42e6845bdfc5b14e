//! Trainings of splats: they learn what they are shown, resume where they stopped, and leave earlier people
//! as they were.

use crate::support::{options, people, run, tempdir, weights};
use burn::tensor::Device;
use std::sync::Arc;
use yoto_avatar::config::{ModelConfig, Numerics, Refine, Setting};
use yoto_avatar::evaluate::metrics::psnr;
use yoto_avatar::loss::{LossTerm, Objective, Patches};
use yoto_avatar::render::{RenderView, Rendered, Renderer};
use yoto_avatar::tradeoff::Axes;
use yoto_avatar::train::{TrainPerson, Trainer};
use yoto_capture::ShardBuilder;
use yoto_capture::camera::{Camera, Pose};
use yoto_synthetic::SyntheticPerson;

pub(crate) const SIZE: u32 = 64;

/// Few splats, for small pictures, with poses as they are: they are exact.
fn config() -> ModelConfig {
    let mut config = ModelConfig::named("splat", "yoto").expect("a tier");
    let splats = config.appearance.splats_mut().expect("splats");
    splats.count = 2000;
    config.refinement.who = Refine::Never;
    config
}

pub(crate) fn trainer(slots: &[usize], steps: u64) -> Trainer {
    let people = people(slots, 12, SIZE);
    Trainer::new(config(), options(steps), people, &Device::flex()).expect("starts")
}

/// Frame `place` of a person's capture, with the identity in `slot`.
pub(crate) fn view_of(person: &TrainPerson, slot: usize, place: usize) -> RenderView {
    let track = &person.shard.track;
    let frame = &track.frames[place];
    RenderView {
        slot,
        pose: Pose::from_frame(frame).expect("a pose"),
        camera: Camera::from_frame(frame, track.image_size).expect("a camera"),
        background: [0.0; 3],
    }
}

/// Frame `place` of a person's capture, as the renderer sees it.
fn shown(renderer: &Renderer, person: &TrainPerson, place: usize) -> Rendered {
    let view = view_of(person, person.slot, place);
    renderer.render(&view).expect("renders")
}

/// Mean PSNR over the capture's frames, dB.
fn mean_psnr(renderer: &Renderer, person: &TrainPerson) -> f64 {
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
    // Frames cost less at a lower resolution, and with fewer splats.
    let axes = Axes::of(&trainer.renderer());
    assert_eq!((axes.samples.len(), axes.precision.len()), (1, 1));
    assert!(axes.scale.len() > 1 && axes.splats.len() > 1);
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
    // Splats are split after the first stop; what no frame shows is guessed before the second.
    for stop in [16, 32] {
        resumed_after(stop);
    }
}

fn resumed_after(stop: usize) {
    let (stopped, resumed, straight) = (tempdir(), tempdir(), tempdir());
    let mut refined = config();
    refined.appearance.splats_mut().expect("splats").coarse = 500;
    refined.refinement.who = Refine::Always;
    let both = people(&[0, 1], 4, SIZE);
    let mut first = Trainer::new(refined, options(44), both, &Device::flex()).expect("starts");
    run(&mut first, stop);
    first.save(stopped.path()).expect("saves");
    assert_eq!(shown_of(&first), if stop == 16 { 500 } else { 2000 });
    let held = weights(stopped.path()).contains_key("splats.0.held");
    assert_eq!(held, stop > 26);
    run(&mut first, 44 - stop);
    first.save(straight.path()).expect("saves");
    assert_eq!(shown_of(&first), 2000);
    let again = yoto_avatar::train::TrainOptions {
        used_steps: stop as u64,
        ..options(44)
    };
    let people = people(&[0, 1], 4, SIZE);
    let mut again =
        Trainer::resume(stopped.path(), again, people, &Device::flex()).expect("resumes");
    run(&mut again, 44 - stop);
    again.save(resumed.path()).expect("saves");
    assert!(weights(resumed.path()) == weights(straight.path()));
    assert!(weights(resumed.path()) != weights(stopped.path()));
}

/// Number of splats of a checkpoint that show, of those in slot 0.
fn shown_of(trainer: &Trainer) -> usize {
    let dir = tempdir();
    trainer.save(dir.path()).expect("saves");
    let opacities = &weights(dir.path())["splats.0.opacities"];
    let numbers = opacities.as_chunks::<4>().0.iter();
    numbers
        .filter(|it| f32::from_le_bytes(**it) > -10.0)
        .count()
}

#[test]
fn splats_are_few_until_poses_are_refined() {
    let mut refined = config();
    refined.appearance.splats_mut().expect("splats").coarse = 500;
    refined.refinement.who = Refine::Always;
    let ada = || people(&[0], 4, SIZE);
    let mut trainer =
        Trainer::new(refined.clone(), options(30), ada(), &Device::flex()).expect("starts");
    let first = tempdir();
    run(&mut trainer, 4);
    assert_eq!(shown_of(&trainer), 500);
    trainer.save(first.path()).expect("saves");
    run(&mut trainer, 6);
    assert_eq!(shown_of(&trainer), 500, "frames were hardly fitted");
    run(&mut trainer, 20);
    assert_eq!(shown_of(&trainer), 2000);
    // A training that does not refine poses any more shows all at once.
    let never = yoto_avatar::train::TrainOptions {
        refine_poses: Some(Refine::Never),
        ..options(2)
    };
    let trainer = Trainer::resume(first.path(), never, ada(), &Device::flex()).expect("resumes");
    assert_eq!(shown_of(&trainer), 2000);
    // One that does goes on with the few.
    let again = yoto_avatar::train::TrainOptions {
        used_steps: 4,
        ..options(30)
    };
    let trainer = Trainer::resume(first.path(), again, ada(), &Device::flex()).expect("resumes");
    assert_eq!(shown_of(&trainer), 500);
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
fn a_new_person_starts_from_their_own_hull_and_leaves_the_others_splats_alone() {
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
    let trainer = trainer(&[0, 1], 1);
    let person = &people(&[0], 12, SIZE)[0];
    // Splats have one kind of numerics.
    let sound = shown(&trainer.renderer(), person, 0);
    let other = trainer.renderer().with_numerics(Numerics::Reference);
    assert_eq!(shown(&other, person, 0).rgb, sound.rgb);

    let setting = "splats.count=3".parse::<Setting>().expect("a setting");
    let error = config().with(&[setting]).expect_err("refused").to_string();
    assert!(error.starts_with("splats.count: must be 64"), "{error}");

    // Poses that are far from their masks.
    let mut nobody = people(&[0], 12, SIZE);
    let shard = std::sync::Arc::make_mut(&mut nobody[0].shard);
    for frame in &mut shard.track.frames {
        frame.translation[0] += 50.0;
    }
    let error = Trainer::new(config(), options(2), nobody, &Device::flex());
    let error = error.err().expect("refused").to_string();
    assert!(error.contains("poses and masks do not agree"), "{error}");
}

/// An objective that nothing evaluates here.
struct Custom;

impl Objective for Custom {
    fn name(&self) -> &'static str {
        "custom"
    }

    fn terms(&self, _: Patches) -> Vec<LossTerm> {
        Vec::new()
    }
}

/// Splats learn by their own loss, so a training that took another objective would not learn by it.
#[test]
fn another_objective_is_refused_where_it_would_be_ignored() {
    let refused = trainer(&[0], 1).with_objective(Box::new(Custom));
    let error = refused
        .err()
        .expect("splats have their own loss")
        .to_string();
    assert!(
        error.contains("tier splat")
            && error.contains("custom")
            && error.contains("whole pictures"),
        "{error}"
    );
    let field = ModelConfig::named("draft", "yoto").expect("a tier");
    let people = people(&[0], 3, SIZE);
    let trainer = Trainer::new(field, options(1), people, &Device::flex()).expect("starts");
    let trainer = trainer.with_objective(Box::new(Custom)).expect("patches");
    assert_eq!(trainer.progress().objective, "custom");
}

/// A frame that shows half of the person, and one that shows nobody, say nothing about what they lack.
#[test]
fn cropped_and_empty_frames_do_not_cut_the_person() {
    let whole = people(&[0], 12, SIZE).remove(0);
    let (track, mut images) = SyntheticPerson::cast(1, 7)[0].capture(12, SIZE);
    let mut track = track;
    // The picture ends above the hips.
    let kept = SIZE as usize * 2 / 5;
    for (frame, image) in track.frames.iter_mut().zip(&mut images).take(6) {
        frame.k[1][2] += (SIZE as usize - kept) as f64;
        let shift = SIZE as usize * (SIZE as usize - kept);
        let left = image.mask.len() - shift;
        image.rgb.copy_within(..3 * left, 3 * shift);
        image.mask.copy_within(..left, shift);
        image.rgb[..3 * shift].fill(0);
        image.mask[..shift].fill(0);
    }
    images[7].mask.fill(0);
    images[7].rgb.fill(0);
    let mut builder = ShardBuilder::new(track);
    for image in &images {
        builder.push(image).expect("a frame");
    }
    let cropped = TrainPerson {
        shard: Arc::new(builder.finish().expect("all frames")),
        ..whole.clone()
    };
    let trainer = Trainer::new(config(), options(1), vec![cropped], &Device::flex());
    let frame = shown(&trainer.expect("starts").renderer(), &whole, 9);
    let mask = whole.shard.image(9).mask;
    let feet = (SIZE * SIZE * 3 / 4) as usize..;
    let covered: usize = mask[feet.clone()].iter().filter(|m| **m > 127).count();
    let shown = mask[feet.clone()].iter().zip(&frame.alpha[feet]);
    let shown = shown.filter(|(m, a)| **m > 127 && **a > 0.5).count();
    assert!(covered > 20 && 2 * shown > covered, "{shown} of {covered}");
}

/// Without identities, everybody is one set of splats, from the first person's hull.
#[test]
fn people_without_identities_share_their_splats() {
    let mut config = ModelConfig::named("splat", "no-identity").expect("a tier");
    config.appearance.splats_mut().expect("splats").count = 500;
    let both = people(&[0, 1], 12, SIZE);
    let mut trainer =
        Trainer::new(config, options(3), both.clone(), &Device::flex()).expect("starts");
    run(&mut trainer, 3);
    let renderer = trainer.renderer();
    for person in &both {
        assert!(mean_psnr(&renderer, person) > 12.0, "{}", person.name);
    }
    let dir = tempdir();
    trainer.save(dir.path()).expect("saves");
    let sets = weights(dir.path());
    assert!(sets.contains_key("splats.0.means") && !sets.contains_key("splats.1.means"));
}
