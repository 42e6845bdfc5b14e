//! A person filmed from one side only.

use crate::support::{options, run};
use burn::tensor::Device;
use std::path::Path;
use std::sync::Arc;
use yoto_avatar::config::{ModelConfig, Refine};
use yoto_avatar::field::splats::opaque_area;
use yoto_avatar::render::{Actor, Light, SceneView, SkinnedSplat};
use yoto_avatar::train::{ModelState, TrainOptions, TrainPerson, Trainer};
use yoto_capture::ShardBuilder;
use yoto_capture::camera::{Camera, Pose};
use yoto_proto::pose_track::PoseTrack;
use yoto_synthetic::SyntheticPerson;

const SIZE: u32 = 64;
const STEPS: u64 = 150;

fn config() -> ModelConfig {
    let mut config = ModelConfig::named("splat", "yoto").expect("a tier");
    config.appearance.splats_mut().expect("splats").count = 2000;
    config.refinement.who = Refine::Never;
    config
}

/// A camera at this angle around the person, radians, that looks at them as the filming one does.
fn camera(angle: f64) -> Camera {
    let front = SyntheticPerson::train_camera(SIZE);
    let eye = [3.2 * angle.sin(), 1.15, 3.2 * angle.cos()];
    Camera::look_at(
        eye,
        [0.0, 0.98, 0.0],
        [0.0, 1.0, 0.0],
        front.k[0][0],
        SIZE,
        SIZE,
    )
}

/// The poses of a person's motion without its turns.
fn poses(person: &SyntheticPerson) -> Vec<Pose> {
    let mut poses = person.motion(16);
    for pose in &mut poses {
        pose.rotations[0] = [0.0; 3];
        pose.translation = [0.0; 3];
    }
    poses
}

/// A film from the given angles, one after the other.
fn film(person: &SyntheticPerson, angles: &[f64]) -> TrainPerson {
    let poses = poses(person);
    let shots: Vec<(Camera, &Pose)> = (poses.iter().enumerate())
        .map(|(place, pose)| (camera(angles[place % angles.len()]), pose))
        .collect();
    let track = PoseTrack {
        skeleton: person.skeleton(),
        image_size: [SIZE, SIZE],
        fps: 15.0,
        distortion: [0.0; 5],
        frames: (0..)
            .zip(&shots)
            .map(|(index, (camera, pose))| camera.to_frame(index, pose))
            .collect(),
    };
    let mut shard = ShardBuilder::new(track);
    for (camera, pose) in &shots {
        shard.push(&person.render(pose, camera)).expect("a frame");
    }
    TrainPerson {
        slot: 0,
        name: "ada".into(),
        shard: Arc::new(shard.finish().expect("a shard")),
    }
}

fn started(film: &TrainPerson, leave_unseen: bool) -> Trainer {
    started_as(config(), film, leave_unseen)
}

fn started_as(config: ModelConfig, film: &TrainPerson, leave_unseen: bool) -> Trainer {
    let options = TrainOptions {
        leave_unseen,
        ..options(STEPS)
    };
    let people = vec![film.clone()];
    Trainer::new(config, options, people, &Device::flex()).expect("starts")
}

fn trained(film: &TrainPerson, leave_unseen: bool) -> Trainer {
    let mut trainer = started(film, leave_unseen);
    run(&mut trainer, STEPS as usize);
    trainer
}

/// The splats of the person as players get them.
fn exported(trainer: &Trainer) -> Vec<SkinnedSplat> {
    let splats = trainer.renderer().skinned_splats(0).expect("reads");
    splats.expect("a model of splats").splats
}

/// Mean difference of the colours from the truth where the person is whole in both, seen from `angle` without light.
fn off(trainer: &Trainer, person: &SyntheticPerson, angle: f64) -> f64 {
    let camera = camera(angle);
    let (mut sum, mut count) = (0.0, 0.0);
    for pose in poses(person).into_iter().step_by(5) {
        let truth = person.render(&pose, &camera);
        let scene = SceneView {
            actors: vec![Actor {
                model: 0,
                slot: 0,
                pose,
                light: Light::Neutral,
            }],
            camera: camera.clone(),
            background: [0.0; 3],
        };
        let rendered = trainer.renderer().render_scene(&scene, &mut |_| true);
        let rendered = rendered.expect("renders");
        for (pixel, alpha) in rendered.alpha.iter().enumerate() {
            if *alpha > 0.8 && truth.mask[pixel] == 255 {
                for c in 0..3 {
                    let value = f64::from(truth.rgb[3 * pixel + c]) / 255.0;
                    sum += (f64::from(rendered.rgb[3 * pixel + c]) - value).abs();
                    count += 1.0;
                }
            }
        }
    }
    sum / count
}

#[test]
fn a_back_that_no_frame_shows_gets_colours_from_what_is_seen() {
    let person = &SyntheticPerson::cast(1, 7)[0];
    let film = film(person, &[-0.5, 0.0, 0.5]);
    let (guessed, left) = (trained(&film, false), trained(&film, true));
    let back = std::f64::consts::PI;
    let (with, without) = (off(&guessed, person, back), off(&left, person, back));
    assert!(with < 0.96 * without, "{with:.3}, {without:.3} without");
    for angle in [-0.5, 0.0, 0.5] {
        let (with, without) = (off(&guessed, person, angle), off(&left, person, angle));
        println!("{angle}: {with:.5}, {without:.5} without");
        assert!(
            with < without + 0.0005,
            "what was filmed stays: {with:.5}, {without:.5} without"
        );
    }
    let notes = guessed.notes().concat();
    assert!(notes.contains("of the surface is in no frame"), "{notes}");
    let notes = left.notes().concat();
    assert!(!notes.contains("in no frame"), "{notes}");
    assert_eq!(left.guessed().expect("reads"), None);
    assert!(exported(&left).iter().all(|splat| !splat.guessed));
    assert_eq!(guessed.parameters(), left.parameters(), "flags are none");
    let (splats, share) = (exported(&guessed), guessed.guessed().expect("reads"));
    let area = |splat: &SkinnedSplat| f64::from(opaque_area(splat.opacity, splat.deviations));
    let flagged = splats.iter().filter(|splat| splat.guessed);
    let by_area = flagged.map(area).sum::<f64>() / splats.iter().map(area).sum::<f64>();
    let share = share.expect("a guess");
    assert!((share - by_area).abs() < 0.001, "{share}, {by_area}");
    assert!(share > 0.1 && share < 0.6, "{share}");
    // The camera is in front, at positive z.
    let depth = |wanted: bool| {
        let own = splats.iter().filter(|splat| splat.guessed == wanted);
        let depths: Vec<f32> = own.map(|splat| splat.mean[2]).collect();
        depths.iter().sum::<f32>() / depths.len() as f32
    };
    let (behind, before) = (depth(true), depth(false));
    assert!(
        behind < before - 0.05,
        "guessed at {behind}, seen at {before}"
    );
}

/// Without the shared body, the guess is all that is known of a back.
#[test]
fn a_back_of_a_start_on_the_hull_gets_colours_from_what_is_seen() {
    let person = &SyntheticPerson::cast(1, 7)[0];
    let film = film(person, &[-0.5, 0.0, 0.5]);
    let [with, without] = [false, true].map(|leave_unseen| {
        let mut config = config();
        config.appearance.splats_mut().expect("splats").surface = false;
        let mut trainer = started_as(config, &film, leave_unseen);
        run(&mut trainer, STEPS as usize);
        off(&trainer, person, std::f64::consts::PI)
    });
    assert!(with < 0.84 * without, "{with:.3}, {without:.3} without");
}

#[test]
fn a_side_that_no_frame_shows_looks_as_the_other() {
    let person = &SyntheticPerson::cast(1, 7)[0];
    let film = film(person, &[0.9, 1.6, 2.2]);
    let (guessed, left) = (trained(&film, false), trained(&film, true));
    let right = -std::f64::consts::FRAC_PI_2;
    let (with, without) = (off(&guessed, person, right), off(&left, person, right));
    assert!(with < 0.62 * without, "{with:.3}, {without:.3} without");
    let notes = guessed.notes().concat();
    assert!(notes.contains("from the other side"), "{notes}");
}

#[test]
fn flags_of_guesses_are_kept_with_a_model_and_dropped_by_a_training_that_leaves_them() {
    let person = &SyntheticPerson::cast(1, 7)[0];
    let film = film(person, &[-0.5, 0.0, 0.5]);
    let flags = |trainer: &Trainer| -> Vec<bool> {
        exported(trainer)
            .iter()
            .map(|splat| splat.guessed)
            .collect()
    };
    let mut trainer = started(&film, false);
    run(&mut trainer, (0.5 * STEPS as f64) as usize);
    assert_eq!(
        trainer.guessed().expect("reads"),
        None,
        "before 0.6 of a run"
    );
    run(&mut trainer, STEPS as usize - (0.5 * STEPS as f64) as usize);
    let kept = flags(&trainer);
    assert!(kept.contains(&true));
    let dir = tempfile::tempdir().expect("a folder");
    trainer.save(dir.path()).expect("saves");
    let priors = |dir: &Path| ModelState::read(dir).expect("a state").priors;
    assert!(priors(dir.path())[&0].starts_with("people "));
    let resumed = |leave_unseen: bool| {
        let options = TrainOptions {
            leave_unseen,
            used_steps: STEPS,
            ..options(STEPS + 2)
        };
        let people = vec![film.clone()];
        Trainer::resume(dir.path(), options, people, &Device::flex()).expect("resumes")
    };
    let mut on = resumed(false);
    assert_eq!(flags(&on), kept);
    run(&mut on, 1);
    assert_eq!(flags(&on), kept, "late in a longer run");
    let mut left = resumed(true);
    run(&mut left, 1);
    assert_eq!(left.guessed().expect("reads"), None);
    let dir = tempfile::tempdir().expect("a folder");
    left.save(dir.path()).expect("saves");
    assert!(priors(dir.path()).is_empty(), "no decoder takes part");
}
