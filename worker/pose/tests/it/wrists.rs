//! Hands that turn at the wrist, against the true ones.

use crate::people::{Clip, Errors, camera, clip};
use yoto_capture::skeleton::transform::{Mat3, rodrigues};
use yoto_capture::skeleton::{Pose, Skeleton};
use yoto_pose::{FitOptions, KeyPointSet, fit};
use yoto_synthetic::SyntheticPerson;

const WRISTS: [(usize, f32); 2] = [(20, 1.0), (21, -1.0)];
/// BlazePose's points of the little fingers, index fingers and thumbs.
const HANDS: std::ops::Range<usize> = 17..23;
const ERRORS: Errors = Errors {
    picture: 0.004,
    space: Some(0.04),
};

/// A person walks for four seconds; their wrists twist by up to 52°, and bend by up to 17° and 40°.
fn poses(person: &SyntheticPerson) -> Vec<Pose> {
    let mut poses = person.motion(120);
    poses.truncate(60);
    for (at, pose) in poses.iter_mut().enumerate() {
        for (wrist, sign) in WRISTS {
            let phase = 2.2 * at as f32 / 15.0 + wrist as f32;
            pose.rotations[wrist] = [
                0.9 * phase.sin(),
                sign * 0.3 * (1.3 * phase).sin(),
                sign * 0.7 * (0.8 * phase + 1.0).sin(),
            ];
        }
    }
    poses
}

fn product(a: Mat3, b: Mat3) -> Mat3 {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

/// The rotation of a joint in the axes of the camera with the extrinsics `e`.
fn seen(skeleton: &Skeleton, pose: &Pose, e: &[[f64; 4]], joint: usize) -> Mat3 {
    let camera: Mat3 = std::array::from_fn(|i| std::array::from_fn(|j| e[i][j]));
    let up: Vec<usize> = std::iter::successors(Some(joint), |it| skeleton.parents[*it]).collect();
    up.into_iter().rev().fold(camera, |sum, joint| {
        product(sum, rodrigues(pose.rotations[joint].map(f64::from)))
    })
}

fn degrees(a: Mat3, b: Mat3) -> f64 {
    let trace: f64 = (0..9).map(|at| a[at / 3][at % 3] * b[at / 3][at % 3]).sum();
    (0.5 * (trace - 1.0)).clamp(-1.0, 1.0).acos().to_degrees()
}

/// The errors of both hands' rotations after a fit, degrees; `spoil` changes the points before it.
fn errors(person: &SyntheticPerson, spoil: impl FnOnce(&mut Clip)) -> Vec<f64> {
    let poses = poses(person);
    let camera = camera(3.0, [720, 1280], 1500.0);
    let mut clip = clip(person, &poses, &camera, KeyPointSet::BlazePose33, ERRORS, 1);
    spoil(&mut clip);
    let options = FitOptions {
        height: Some(clip.height),
        ..FitOptions::default()
    };
    let fitted = fit(&clip.points, &options, &mut |_, _| ()).expect("fits");
    let truth = Skeleton::from_track(&person.skeleton()).expect("a skeleton");
    let found = Skeleton::from_track(&fitted.track.skeleton).expect("a skeleton");
    let mut errors = Vec::new();
    for (pose, frame) in poses.iter().zip(&fitted.track.frames) {
        let fitted = Pose::from_frame(frame).expect("a pose");
        errors.extend(WRISTS.map(|(wrist, _)| {
            let turned = seen(&truth, pose, &camera.e, wrist);
            degrees(turned, seen(&found, &fitted, &frame.e, wrist))
        }));
    }
    errors
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[test]
fn points_of_a_hand_turn_the_wrist() {
    let person = &SyntheticPerson::cast(3, 7)[0];
    let off = mean(&errors(person, |_| ()));
    assert!(off < 13.0, "{off}°");
    let stiff = mean(&errors(person, |clip| {
        for frame in &mut clip.points.frames {
            HANDS.for_each(|point| frame.picture[point][2] = 0.0);
        }
    }));
    assert!(stiff > 40.0, "without the points: {stiff}°");
}

/// From the first guess alone, the search tilts a hand the wrong way in five frames, by up to 130°.
#[test]
fn no_hand_is_tilted_the_wrong_way() {
    let person = &SyntheticPerson::cast(3, 7)[2];
    let off = errors(person, |_| ());
    let worst = off.iter().copied().fold(0.0, f64::max);
    assert!(worst < 45.0 && mean(&off) < 12.0, "{worst}°, {off:?}");
}
