//! Fits of synthetic people with known joints, and key points that can't be fitted.

use crate::people::{Clip, Errors, camera, clip, error, joints};
use yoto_pose::{FitOptions, FrameKeyPoints, KeyPointSet, KeyPoints, PoseError, fit};
use yoto_synthetic::SyntheticPerson;

/// Errors of a typical detector: half a hundredth of the body's height, and 40 mm in space.
const ERRORS: Errors = Errors {
    picture: 0.005,
    space: Some(0.04),
};
const FLAT: Errors = Errors {
    space: None,
    ..ERRORS
};

/// The first 40 frames of eight seconds, in which a person turns twice.
fn walk(set: KeyPointSet, errors: Errors, down: f64) -> Clip {
    let person = &SyntheticPerson::cast(3, 7)[1];
    let mut poses = person.motion(120);
    poses.truncate(40);
    clip(
        person,
        &poses,
        &camera(down, [720, 1280], 1500.0),
        set,
        errors,
        1,
    )
}

fn told(clip: &Clip) -> FitOptions {
    FitOptions {
        height: Some(clip.height),
        ..FitOptions::default()
    }
}

/// Fits a clip and returns the mean error of its joints, millimetres.
fn millimetres(clip: &Clip) -> f64 {
    let fitted = fit(&clip.points, &told(clip), &mut |_, _| ()).expect("fits");
    assert_eq!(fitted.track.check(), []);
    assert_eq!(fitted.track.frames.len(), clip.joints.len());
    1e3 * error(&joints(&fitted), &clip.joints)
}

#[test]
fn landmarks_with_depths_give_joints_to_a_finger_s_breadth() {
    let clip = walk(KeyPointSet::BlazePose33, ERRORS, 3.0);
    let mut told_of = Vec::new();
    let fitted = fit(&clip.points, &told(&clip), &mut |done, all| {
        told_of.push((done, all));
    });
    let fitted = fitted.expect("fits");
    let off = 1e3 * error(&joints(&fitted), &clip.joints);
    assert!(off < 25.0, "{off} mm");
    let body = clip.focal * clip.height / 3.2;
    assert!(
        fitted.reprojection_px < 0.007 * body,
        "{} px",
        fitted.reprojection_px
    );
    assert!((fitted.height - clip.height).abs() < 1e-9);
    assert!((fitted.camera_down_degrees - 3.0).abs() < 3.0, "{fitted:?}");
    assert!(
        (fitted.focal / clip.focal - 1.0).abs() < 0.15,
        "{}",
        fitted.focal
    );
    assert!(told_of.is_sorted(), "{told_of:?}");
    let (first, last) = (told_of[0], told_of[told_of.len() - 1]);
    assert!(first.0 == 0 && last.0 == last.1, "{told_of:?}");
}

#[test]
fn joints_of_the_tree_are_fitted_as_well() {
    let off = millimetres(&walk(KeyPointSet::Joints24, ERRORS, 3.0));
    assert!(off < 25.0, "{off} mm");
}

#[test]
fn a_camera_that_looks_down_is_found_out() {
    let clip = walk(KeyPointSet::BlazePose33, ERRORS, 20.0);
    let fitted = fit(&clip.points, &told(&clip), &mut |_, _| ()).expect("fits");
    let off = 1e3 * error(&joints(&fitted), &clip.joints);
    assert!(off < 25.0, "{off} mm");
    let down = fitted.camera_down_degrees;
    assert!((down - 20.0).abs() < 6.0, "{down}");
}

/// A detector that tells too little depth, and slowly changes its mind about each point.
#[test]
fn depths_that_tell_little_are_found_by_the_network() {
    let mut clip = walk(KeyPointSet::BlazePose33, ERRORS, 3.0);
    for (frame, points) in clip.points.frames.iter_mut().enumerate() {
        for (point, at) in points.space.iter_mut().enumerate() {
            let wave = (0.1 * frame as f64 + 2.4 * point as f64).sin();
            at[2] = 0.6 * at[2] + 0.15 * wave;
        }
    }
    let off = |lift: bool| {
        let options = FitOptions {
            lift,
            ..told(&clip)
        };
        let fitted = fit(&clip.points, &options, &mut |_, _| ()).expect("fits");
        1e3 * error(&joints(&fitted), &clip.joints)
    };
    let (told, found) = (off(false), off(true));
    assert!(found < 0.9 * told, "{found} mm, and {told} mm as told");
}

#[test]
fn pictures_alone_give_joints_to_a_hand_s_breadth() {
    for (set, most) in [
        (KeyPointSet::Coco17, 75.0),
        (KeyPointSet::OpenPose25, 60.0),
        (KeyPointSet::BlazePose33, 50.0),
    ] {
        let off = millimetres(&walk(set, FLAT, 3.0));
        assert!(off < most, "{set:?}: {off} mm");
    }
}

#[test]
fn a_known_focal_length_is_kept() {
    let mut clip = walk(KeyPointSet::BlazePose33, ERRORS, 3.0);
    clip.points.frames.truncate(5);
    let options = FitOptions {
        focal: Some(2000.0),
        ..FitOptions::default()
    };
    let fitted = fit(&clip.points, &options, &mut |_, _| ()).expect("fits");
    assert!((fitted.focal - 2000.0).abs() < 1e-6);
    assert!(
        fitted
            .track
            .frames
            .iter()
            .all(|frame| (frame.k[0][0] - 2000.0).abs() < 1e-6)
    );
    assert!((fitted.height - 1.72).abs() < 1e-9);
}

/// A detector that takes the back for the front calls left right.
#[test]
fn a_body_that_is_turned_round_in_some_frames_is_turned_back() {
    let mut clip = walk(KeyPointSet::BlazePose33, ERRORS, 3.0);
    let sides = [(1, 4), (2, 5), (3, 6)].into_iter();
    let sides: Vec<_> = sides
        .chain((7..33).step_by(2).map(|at| (at, at + 1)))
        .collect();
    for frame in &mut clip.points.frames[12..16] {
        for &(left, right) in &sides {
            frame.picture.swap(left, right);
            frame.space.swap(left, right);
        }
    }
    let fitted = fit(&clip.points, &told(&clip), &mut |_, _| ()).expect("fits");
    let off = 1e3 * error(&joints(&fitted), &clip.joints);
    assert!(off < 25.0, "{off} mm");
    let is_told = fitted.notes.iter().any(|note| note.contains("in 4 frames"));
    assert!(is_told, "{:?}", fitted.notes);
}

#[test]
fn single_frames_and_pairs_are_fitted() {
    for (set, errors) in [
        (KeyPointSet::BlazePose33, ERRORS),
        (KeyPointSet::Coco17, FLAT),
    ] {
        for count in [1, 2, 3] {
            let mut clip = walk(set, errors, 3.0);
            clip.points.frames.truncate(count);
            clip.joints.truncate(count);
            let off = millimetres(&clip);
            let most = if errors.space.is_some() { 50.0 } else { 220.0 };
            assert!(off < most, "{set:?}, {count} frames: {off} mm");
        }
    }
}

#[test]
fn points_that_were_not_seen_don_t_count() {
    let mut clip = walk(KeyPointSet::OpenPose25, FLAT, 3.0);
    clip.points.frames.truncate(20);
    clip.joints.truncate(20);
    for (at, frame) in clip.points.frames.iter_mut().enumerate() {
        frame.picture[at % 20 + 1] = [0.0; 3];
    }
    let off = millimetres(&clip);
    assert!(off < 90.0, "{off} mm");
}

/// The error of a fit of three good frames after `spoil`.
fn refused(spoil: impl FnOnce(&mut KeyPoints)) -> String {
    let mut clip = walk(KeyPointSet::BlazePose33, ERRORS, 3.0);
    clip.points.frames.truncate(3);
    spoil(&mut clip.points);
    let refused = fit(&clip.points, &FitOptions::default(), &mut |_, _| ());
    refused.expect_err("must be refused").to_string()
}

#[test]
fn faults_name_frame_and_field() {
    let message = refused(|p| p.frames[1].picture[4][1] = f64::NAN);
    assert!(
        message.starts_with("frame 1: picture[4][1]: NaN"),
        "{message}"
    );
    let message = refused(|p| p.frames[2].picture[0][0] = f64::INFINITY);
    assert!(
        message.starts_with("frame 2: picture[0][0]: inf"),
        "{message}"
    );
    let message = refused(|p| p.frames[0].picture[5][2] = 1.5);
    assert!(
        message.starts_with("frame 0: picture[5][2]: 1.5"),
        "{message}"
    );
    let message = refused(|p| p.frames[1].space[32][2] = f64::NEG_INFINITY);
    assert!(
        message.starts_with("frame 1: space[32][2]: -inf"),
        "{message}"
    );
    let message = refused(|p| p.frames[1].picture.truncate(32));
    assert!(
        message.starts_with("frame 1: picture: 32 points instead of 33"),
        "{message}"
    );
    let message = refused(|p| p.frames[1].space.truncate(1));
    assert!(
        message.starts_with("frame 1: space: 1 points instead of 33"),
        "{message}"
    );
    let message = refused(|p| {
        p.frames[2]
            .picture
            .iter_mut()
            .for_each(|point| point[2] = 0.0)
    });
    assert!(
        message.starts_with("frame 2: picture: 0 points were seen"),
        "{message}"
    );
    let message = refused(|p| p.frames[2].picture.fill([5.0, 5.0, 1.0]));
    assert!(
        message.starts_with("frame 2: picture: the points lie within 0.0"),
        "{message}"
    );
    let message = refused(|p| p.frames.swap(0, 1));
    assert!(message.starts_with("frame 0: index"), "{message}");
    assert!(refused(|p| p.frames.clear()).starts_with("frames: 0 frames"));
    assert!(refused(|p| p.fps = f64::NAN).starts_with("fps: NaN"));
    assert!(refused(|p| p.image_size = [0, 5]).starts_with("image_size[0]: 0"));
}

#[test]
fn options_beyond_reason_are_refused() {
    let clip = walk(KeyPointSet::BlazePose33, ERRORS, 3.0);
    for (focal, height, field) in [
        (Some(0.0), None, "focal"),
        (Some(f64::NAN), None, "focal"),
        (None, Some(0.0), "height"),
        (None, Some(f64::INFINITY), "height"),
    ] {
        let options = FitOptions {
            lift: true,
            focal,
            height,
            upright: true,
        };
        let refused = fit(&clip.points, &options, &mut |_, _| ()).expect_err("refused");
        assert!(
            matches!(refused, PoseError::Setting { field: named, .. } if named == field),
            "{refused}"
        );
    }
}

#[test]
fn points_of_no_body_end_in_a_track_or_an_error() {
    let mut state = 1u64;
    let mut number = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 33) as f64 / f64::from(1u32 << 31)
    };
    for set in [
        KeyPointSet::BlazePose33,
        KeyPointSet::Coco17,
        KeyPointSet::Joints24,
    ] {
        let mut row = |by: f64| [by * number(), by * number(), number()];
        let frames = (0..6).map(|index| FrameKeyPoints {
            index: 7 * index,
            picture: (0..set.points()).map(|_| row(400.0)).collect(),
            space: (0..set.points()).map(|_| row(1.0)).collect(),
            ..FrameKeyPoints::default()
        });
        let points = KeyPoints {
            set,
            image_size: [400, 400],
            fps: 30.0,
            frames: frames.collect(),
        };
        if let Ok(fitted) = fit(&points, &FitOptions::default(), &mut |_, _| ()) {
            assert_eq!(fitted.track.check(), [], "{set:?}");
        }
    }
}
