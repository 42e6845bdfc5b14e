use super::*;
use crate::SyntheticPerson;

const NONE: Estimator = Estimator {
    rotation: 0.0,
    frames: 2.5,
    bias: 0.0,
    hidden: 1.0,
    across: 0.0,
    along: 0.0,
    lean: 0.0,
    focal: 0.0,
    bones: 0.0,
    mistakes: 0.0,
};

fn film(frames: usize) -> PoseTrack {
    SyntheticPerson::cast(1, 7)[0].capture(frames, 16).0
}

/// Root mean square rotation error of a joint, and its correlation with the next frame's.
fn rotation_error(exact: &PoseTrack, found: &PoseTrack) -> (f64, f64) {
    let error = |i: usize, joint: usize| {
        let [a, b] = [exact, found].map(|track| rotation(&track.frames[i], joint));
        compose_axis_angle(scale(a, -1.0), b)
    };
    let (mut all, mut next, mut count) = (0.0, 0.0, 0.0);
    for i in 1..exact.frames.len() {
        for joint in 0..exact.joints() {
            let (now, before) = (error(i, joint), error(i - 1, joint));
            all += dot(now, now);
            next += dot(now, before);
            count += 1.0;
        }
    }
    ((all / count).sqrt(), next / all)
}

#[test]
fn errors_have_the_size_that_is_asked_for() {
    let exact = film(120);
    let found = |it: Estimator| it.estimate(&exact, 3).expect("an estimate");
    let none = found(NONE);
    assert!(none.mistakes.is_empty() && rotation_error(&exact, &none.track).0 < 1e-9);
    let (size, alike) = rotation_error(
        &exact,
        &found(Estimator {
            rotation: 0.07,
            ..NONE
        })
        .track,
    );
    assert!((size - 0.07).abs() < 0.01 && alike > 0.8, "{size} {alike}");
    let (size, alike) = rotation_error(&exact, &found(Estimator { bias: 0.05, ..NONE }).track);
    assert!(
        (size - 0.05).abs() < 0.015 && alike > 0.95,
        "{size} {alike}"
    );
    let same = Estimator::default().estimate(&exact, 3);
    assert_eq!(same, Estimator::default().estimate(&exact, 3));
    assert_ne!(same, Estimator::default().estimate(&exact, 4));
}

#[test]
fn a_wrong_focal_length_moves_the_root_along_its_ray() {
    let exact = film(4);
    let focal = Estimator { focal: 0.2, ..NONE };
    let found = focal.estimate(&exact, 5).expect("an estimate").track;
    let seen = |track: &PoseTrack| {
        let frame = &track.frames[2];
        let camera = Camera::from_frame(frame, track.image_size).expect("a camera");
        let root = add(track.skeleton.rest_joints[0], frame.translation);
        camera.project(root).expect("in front")
    };
    let (a, b) = (seen(&exact), seen(&found));
    assert!(
        (a[0] - b[0]).abs() < 1e-6 && (a[1] - b[1]).abs() < 1e-6,
        "{a:?} {b:?}"
    );
    let moved = length(sub(
        exact.frames[2].translation,
        found.frames[2].translation,
    ));
    assert!(moved > 0.05, "{moved}");
}

#[test]
fn bones_change_alike_on_both_sides() {
    let exact = film(2);
    let bones = Estimator { bones: 0.1, ..NONE };
    let found = bones.estimate(&exact, 5).expect("an estimate").track;
    let (before, after) = (&exact.skeleton.rest_joints, &found.skeleton.rest_joints);
    assert_eq!(other_sides(&exact.skeleton), other_sides(&found.skeleton));
    assert!(before != after && before[0] == after[0]);
}

#[test]
fn as_many_frames_are_wrong_as_asked_for() {
    let exact = film(100);
    let wrong = Estimator {
        mistakes: 0.1,
        ..NONE
    };
    let found = wrong.estimate(&exact, 5).expect("an estimate");
    assert_eq!(found.mistakes.len(), 10);
    assert!(found.mistakes.is_sorted_by(|a, b| a.0 < b.0));
    let differs = |(a, b): (&Frame, &Frame)| {
        let pairs = a.pose.as_chunks::<3>().0.iter();
        let apart = pairs
            .zip(b.pose.as_chunks::<3>().0)
            .map(|(a, b)| length(compose_axis_angle(scale(*a, -1.0), *b)));
        apart.fold(0.0, f64::max) > 1e-6
    };
    let pairs = exact.frames.iter().zip(&found.track.frames);
    let positions: Vec<usize> = (0..)
        .zip(pairs)
        .filter(|(_, it)| differs(*it))
        .map(|(i, _)| i)
        .collect();
    let named: Vec<usize> = found
        .mistakes
        .iter()
        .map(|(position, _)| *position)
        .collect();
    assert_eq!(positions, named);
}
