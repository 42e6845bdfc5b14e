//! Frames whose poses are wrong, not just imprecise: found, and read otherwise or left out.

use crate::config::{ModelConfig, Refine};
use crate::train::{Budget, TrainOptions, TrainPerson, Trainer};
use burn::tensor::Device;
use std::collections::BTreeSet;
use std::sync::Arc;
use yoto_capture::ShardBuilder;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::readings::{Reading, Sides};
use yoto_proto::correction::other_sides;
use yoto_proto::pose_track::PoseTrack;
use yoto_synthetic::{Estimator, SyntheticPerson};

const STEPS: u64 = 500;

/// Puts `pose` into the frame at `position`.
fn put(track: &mut PoseTrack, position: usize, pose: &Pose) {
    let frame = &mut track.frames[position];
    frame.pose = (pose.rotations.iter().flatten())
        .map(|v| f64::from(*v))
        .collect();
    frame.translation = pose.translation.map(f64::from);
}

/// Readings after a training on a film in which `break_it` was done, and the frames left out.
fn found(
    break_it: impl FnOnce(&mut PoseTrack, &dyn Fn(&PoseTrack, usize) -> Vec<(Reading, Pose)>),
) -> (Vec<(usize, Reading)>, Vec<usize>, Vec<String>) {
    let (mut track, images) = SyntheticPerson::cast(1, 7)[0].capture(32, 64);
    let skeleton = Skeleton::from_track(&track.skeleton).expect("a skeleton");
    let other = other_sides(&track.skeleton).expect("symmetric");
    let sides = Sides::new(other, &skeleton.parents);
    let readings = |track: &PoseTrack, position: usize| {
        let frame = &track.frames[position];
        let camera = Camera::from_frame(frame, track.image_size).expect("a camera");
        sides.readings(&Pose::from_frame(frame).expect("a pose"), &camera)
    };
    break_it(&mut track, &readings);
    let mut builder = ShardBuilder::new(track);
    for image in &images {
        builder.push(image).expect("a frame");
    }
    let person = TrainPerson {
        slot: 0,
        name: "ada".into(),
        shard: Arc::new(builder.finish().expect("a shard")),
    };
    let mut config = ModelConfig::named("draft", "yoto").expect("a tier");
    config.optimise.patches = 4;
    config.refinement.who = Refine::Always;
    let options = TrainOptions {
        budget: Budget::Steps(STEPS),
        ..TrainOptions::default()
    };
    let mut trainer = Trainer::new(config, options, vec![person], &Device::flex()).expect("starts");
    while !trainer.finished() {
        trainer.step().expect("a step");
    }
    let poses = trainer.model.state.poses[0].as_ref().expect("refined");
    let (readings, left_out) = poses.doubts();
    (readings, left_out, trainer.notes())
}

#[test]
fn wrong_frames_are_found_and_right_ones_are_left_alone() {
    let (readings, _, notes) = found(|track, readings| {
        for (position, which) in [(4, 3), (20, 3), (12, 2)] {
            let pose = readings(track, position).swap_remove(which).1;
            put(track, position, &pose);
        }
        // The tracker lost the person: a rest pose half a metre beside.
        let mut lost = Pose::rest(track.joints());
        lost.translation = track.frames[26].translation.map(|v| v as f32);
        lost.translation[0] += 0.5;
        put(track, 26, &lost);
    });
    let expected = [
        (4, Reading::FrontToBack),
        (12, Reading::Limbs),
        (20, Reading::FrontToBack),
        (26, Reading::Between),
    ];
    assert_eq!(readings, expected);
    assert!(
        notes.iter().any(|note| note.contains("frames 4, 20")),
        "{notes:?}"
    );
}

#[test]
fn most_mistakes_of_an_estimator_are_found() {
    let estimator = Estimator {
        mistakes: 0.16,
        ..Estimator::default()
    };
    let mut injected = Vec::new();
    let (readings, left_out, _) = found(|track, _| {
        let estimate = estimator.estimate(track, 3).expect("an estimate");
        *track = estimate.track;
        injected = estimate.mistakes;
    });
    let doubted: BTreeSet<usize> = readings
        .iter()
        .map(|(position, _)| *position)
        .chain(left_out)
        .collect();
    let wrong: BTreeSet<usize> = injected.iter().map(|(position, _)| *position).collect();
    let hits = wrong.intersection(&doubted).count();
    assert!(4 * hits >= 3 * wrong.len(), "{wrong:?} {doubted:?}");
    assert!(doubted.len() <= hits + 1, "{wrong:?} {doubted:?}");
}

#[test]
fn exact_frames_are_read_as_they_are() {
    let (readings, left_out, _) = found(|_, _| {});
    assert!(
        readings.is_empty() && left_out.is_empty(),
        "{readings:?} {left_out:?}"
    );
}
