//! Refinement of estimated poses: it brings poses closer to the exact ones, and stays finite where
//! there is nothing to refine or everything is extreme.

use crate::support::{options, run};
use burn::tensor::Device;
use std::sync::Arc;
use yoto_avatar::config::{ModelConfig, Refine};
use yoto_avatar::train::{TrainPerson, Trainer};
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;
use yoto_capture::{FrameImage, Shard, ShardBuilder};
use yoto_proto::pose_track::PoseTrack;
use yoto_synthetic::SyntheticPerson;

/// A filmed person with `track` in place of the exact poses.
fn filmed(track: PoseTrack, images: &[FrameImage]) -> TrainPerson {
    let mut builder = ShardBuilder::new(track);
    for image in images {
        builder.push(image).expect("a synthetic frame is valid");
    }
    let shard: Shard = builder.finish().expect("all frames are there");
    TrainPerson {
        slot: 0,
        name: "ada".into(),
        shard: Arc::new(shard),
    }
}

/// `track` with smooth errors: of `angle` radians per joint, about, and a third of it in metres.
fn estimated(track: &PoseTrack, angle: f64) -> PoseTrack {
    let mut track = track.clone();
    for (i, frame) in track.frames.iter_mut().enumerate() {
        let wave = |k: usize| (0.7 * i as f64 + 2.4 * k as f64).sin();
        for (k, number) in frame.pose.iter_mut().enumerate() {
            *number += angle * wave(k);
        }
        for (k, number) in frame.translation.iter_mut().enumerate() {
            *number += angle / 3.0 * wave(k + 1);
        }
    }
    track
}

fn poses(track: &PoseTrack) -> Vec<Pose> {
    let poses = track.frames.iter().map(Pose::from_frame);
    poses.collect::<Result<_, _>>().expect("poses")
}

/// Root mean square distance of the joints' images, pixels.
fn pixels_off(track: &PoseTrack, found: &[(usize, Pose)]) -> f64 {
    let skeleton = Skeleton::from_track(&track.skeleton).expect("a skeleton");
    let exact = poses(track);
    let (mut sum, mut count) = (0.0, 0);
    for (place, pose) in found {
        let camera = Camera::from_frame(&track.frames[*place], track.image_size).expect("a camera");
        let pairs = skeleton
            .posed_joints(pose)
            .into_iter()
            .zip(skeleton.posed_joints(&exact[*place]));
        for (a, b) in pairs {
            let [a, b] = [a, b].map(|joint| camera.project(joint).expect("in front"));
            sum += (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
            count += 1;
        }
    }
    (sum / f64::from(count)).sqrt()
}

fn config() -> ModelConfig {
    let mut config = ModelConfig::named("draft", "yoto").expect("a tier");
    config.optimise.patches = 4;
    config.refinement.who = Refine::Always;
    config
}

fn config_of_splats() -> ModelConfig {
    let mut config = ModelConfig::named("splat", "yoto").expect("a tier");
    let splats = config.appearance.splats_mut().expect("splats");
    (splats.count, splats.coarse) = (2000, 500);
    config.refinement.who = Refine::Always;
    config
}

#[test]
fn estimated_poses_come_closer_to_the_exact_ones() {
    poses_come_closer(config());
}

#[test]
fn splats_bring_estimated_poses_closer_to_the_exact_ones() {
    poses_come_closer(config_of_splats());
}

fn poses_come_closer(config: ModelConfig) {
    let (track, images) = SyntheticPerson::cast(1, 7)[0].capture(16, 64);
    let given = estimated(&track, 0.1);
    let before: Vec<(usize, Pose)> = poses(&given).into_iter().enumerate().collect();
    let person = vec![filmed(given, &images)];
    let mut trainer = Trainer::new(config, options(320), person, &Device::flex()).expect("starts");
    run(&mut trainer, 320);
    let (before, after) = (
        pixels_off(&track, &before),
        pixels_off(&track, &trainer.refined_poses(0)),
    );
    println!("{before:.2} pixels off before, {after:.2} after");
    assert!(
        after < 0.6 * before,
        "{before:.2} pixels off before, {after:.2} after"
    );
}

#[test]
fn a_picture_that_was_not_trained_on_finds_its_pose() {
    picture_finds_its_pose(config());
}

#[test]
fn a_picture_finds_its_pose_among_splats() {
    picture_finds_its_pose(config_of_splats());
}

fn picture_finds_its_pose(mut plain: ModelConfig) {
    let (track, images) = SyntheticPerson::cast(1, 7)[0].capture(16, 64);
    let given = estimated(&track, 0.1);
    plain.refinement.who = Refine::Never;
    let person = vec![filmed(track.clone(), &images)];
    let mut trainer = Trainer::new(plain, options(200), person, &Device::flex()).expect("starts");
    run(&mut trainer, 200);
    let camera = Camera::from_frame(&track.frames[5], track.image_size).expect("a camera");
    let pose = poses(&given).swap_remove(5);
    let fitted = trainer
        .fitted_pose(0, &pose, &camera, &images[5])
        .expect("fits");
    let (before, after) = (
        pixels_off(&track, &[(5, pose.clone())]),
        pixels_off(&track, &[(5, fitted)]),
    );
    println!("{before:.2} pixels off before, {after:.2} after");
    assert!(
        after < 0.6 * before,
        "{before:.2} pixels off before, {after:.2} after"
    );
    let error = trainer.fitted_pose(1, &pose, &camera, &images[5]);
    assert!(error.expect_err("nobody").to_string().contains("slot 1"));
}

#[test]
fn refinement_stays_finite_at_the_extremes() {
    stays_finite(config);
}

#[test]
fn refinement_with_splats_stays_finite_at_the_extremes() {
    stays_finite(config_of_splats);
}

fn stays_finite(config: fn() -> ModelConfig) {
    let (track, images) = SyntheticPerson::cast(1, 7)[0].capture(3, 48);
    let alone = |track: &PoseTrack| {
        let mut track = track.clone();
        track.frames.truncate(1);
        track
    };
    let bent = |track: &PoseTrack| {
        let mut track = track.clone();
        for frame in &mut track.frames {
            frame.pose[3 * 18..3 * 19].copy_from_slice(&[0.0, std::f64::consts::PI, 0.0]);
        }
        track
    };
    // As large in the picture from that many times as far.
    let far = |track: &PoseTrack, by: f64| {
        let mut track = track.clone();
        for frame in &mut track.frames {
            frame.e[2][3] *= by;
            frame.k[0][0] *= by;
            frame.k[1][1] *= by;
        }
        track
    };
    let focal = 1e5 / track.frames[0].k[0][0];
    let empty: Vec<FrameImage> = images
        .iter()
        .map(|image| FrameImage {
            rgb: vec![0; image.rgb.len()],
            mask: vec![0; image.mask.len()],
            ..image.clone()
        })
        .collect();
    for (name, track, images) in [
        ("one frame", alone(&track), &images[..1]),
        ("a joint at π", bent(&track), &images[..]),
        ("50 metres away", far(&track, 50.0 / 3.0), &images[..]),
        (
            "a focal length of 10⁵ pixels",
            far(&track, focal),
            &images[..],
        ),
        ("empty masks", track.clone(), &empty[..]),
        ("poses far off", estimated(&track, 2.0), &images[..]),
    ] {
        let given = poses(&track);
        let person = vec![filmed(track, images)];
        let mut trainer = match Trainer::new(config(), options(30), person, &Device::flex()) {
            Ok(trainer) => trainer,
            // Splats start on a hull, which these lack.
            Err(error) => {
                let error = error.to_string();
                let hull = error.contains("poses and masks do not agree");
                assert!(
                    hull && ["empty masks", "poses far off"].contains(&name),
                    "{error}"
                );
                continue;
            }
        };
        run(&mut trainer, 30);
        let found = trainer.refined_poses(0);
        assert_eq!(found.len(), given.len(), "{name}");
        for (place, pose) in found {
            let numbers = pose.rotations.iter().flatten().chain(&pose.translation);
            assert!(numbers.clone().all(|v| v.is_finite()), "{name}: {pose:?}");
            let moved = (0..3).map(|a| (pose.translation[a] - given[place].translation[a]).abs());
            let moved = moved.fold(0.0, f32::max);
            assert!(moved < 0.5, "{name}: the root moved by {moved} m");
            if name == "one frame" || name == "empty masks" {
                assert!(
                    moved < 1e-6,
                    "{name}: nothing tells how to move by {moved} m"
                );
            }
        }
    }
}
