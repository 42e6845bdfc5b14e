//! Each correction undoes its mistake.

use super::*;

/// Two arms and a head on a root off the origin, seen by a camera that looks down a little.
fn track(frames: u32) -> PoseTrack {
    let (sin, cos) = 0.3f64.sin_cos();
    let frame = |index: u32| Frame {
        index: 10 + index,
        pose: (0..12).map(|i| 0.1 * f64::from(i + index) - 0.4).collect(),
        translation: [0.2, 0.1 * f64::from(index), -0.3],
        k: [[50.0, 0.0, 30.0], [0.0, 50.0, 33.0], [0.0, 0.0, 1.0]],
        e: [
            [1.0, 0.0, 0.0, 0.1],
            [0.0, -cos, sin, 0.9],
            [0.0, -sin, -cos, 3.0],
            [0.0, 0.0, 0.0, 1.0],
        ],
    };
    PoseTrack {
        skeleton: Skeleton {
            names: ["root", "left", "right", "head"].map(String::from).to_vec(),
            parents: vec![-1, 0, 0, 0],
            rest_joints: vec![
                [0.0, 1.0, 0.0],
                [0.5, 1.1, 0.0],
                [-0.5, 1.1, 0.0],
                [0.0, 1.5, 0.0],
            ],
        },
        image_size: [64, 64],
        distortion: [0.0; 5],
        fps: 15.0,
        frames: (0..frames).map(frame).collect(),
    }
}

fn apply(correction: Correction, track: &PoseTrack) -> Corrected {
    correction.apply(track).expect("applies")
}

/// Largest difference between the numbers of two tracks.
fn difference(a: &PoseTrack, b: &PoseTrack) -> f64 {
    let numbers = |t: &PoseTrack| -> Vec<f64> {
        let frames = t.frames.iter().flat_map(|f| {
            let (k, e) = (f.k.into_iter().flatten(), f.e.into_iter().flatten());
            f.pose
                .iter()
                .copied()
                .chain(f.translation)
                .chain(k)
                .chain(e)
        });
        frames
            .chain(t.skeleton.rest_joints.iter().flatten().copied())
            .collect()
    };
    let (a, b) = (numbers(a), numbers(b));
    assert_eq!(a.len(), b.len());
    a.iter()
        .zip(&b)
        .map(|(x, y)| (x - y).abs())
        .fold(0.0, f64::max)
}

#[test]
fn nothing_asked_changes_nothing() {
    let (track, correction) = (track(3), Correction::default());
    let corrected = apply(correction, &track);
    assert!(correction.is_identity() && correction.to_string().is_empty());
    assert_eq!(corrected.track, track);
    let same = |s: &Source| s.image == s.mask;
    assert!(corrected.sources.iter().all(same));
}

#[test]
fn corrections_that_are_their_own_inverse_come_back() {
    let twice = [
        Correction {
            extrinsics: Extrinsics::CameraToWorld,
            ..Correction::default()
        },
        Correction {
            camera_axes: CameraAxes::OpenGl,
            ..Correction::default()
        },
        Correction {
            turn_bodies: 180.0,
            ..Correction::default()
        },
    ];
    let mirrors = [Mirror::Poses, Mirror::Limbs, Mirror::Labels, Mirror::Images];
    let mirrors = mirrors.map(|mirror| Correction {
        mirror,
        ..Correction::default()
    });
    let track = track(2);
    for correction in twice.into_iter().chain(mirrors) {
        let once = apply(correction, &track).track;
        assert!(difference(&once, &track) > 0.05, "{correction}");
        let back = apply(correction, &once).track;
        assert!(difference(&back, &track) < 1e-9, "{correction}");
    }
}

#[test]
fn turning_by_quarters_comes_round() {
    let original = track(2);
    let quarter = Correction {
        turn_bodies: 90.0,
        ..Correction::default()
    };
    let mut turned = original.clone();
    for _ in 0..4 {
        turned = apply(quarter, &turned).track;
    }
    assert!(difference(&turned, &original) < 1e-9);
    // Up becomes forward: the root, 1 m up, is 1 m along z.
    let once = apply(quarter, &original).track;
    let z = once.skeleton.rest_joints[0][2] + once.frames[0].translation[2];
    assert!((z - 1.0).abs() < 1e-9, "{z}");
}

#[test]
fn units_and_scales_are_those_named() {
    let original = track(1);
    let correction = Correction {
        units: Units {
            camera: Unit::Millimetre,
            root: Unit::Centimetre,
            ..Units::default()
        },
        k_scale: 0.5,
        ..Correction::default()
    };
    let frame = &apply(correction, &original).track.frames[0];
    assert!((frame.e[2][3] - 0.003).abs() < 1e-12);
    assert!((frame.translation[0] - 0.002).abs() < 1e-12);
    assert_eq!(
        frame.k,
        [[25.0, 0.0, 15.0], [0.0, 25.0, 16.5], [0.0, 0.0, 1.0]]
    );
    assert_eq!(
        correction.to_string(),
        "--units camera=mm,root=cm --k-scale 0.5"
    );
    let all = Correction {
        units: Units::all(Unit::Millimetre),
        ..Correction::default()
    };
    assert_eq!(all.to_string(), "--units mm");
    let rest = apply(all, &original).track.skeleton.rest_joints;
    assert!((rest[3][1] - 0.0015).abs() < 1e-12);
}

#[test]
fn shifts_pair_frames_with_the_masks_and_poses_beside_them() {
    let original = track(4);
    let correction = Correction {
        mask_shift: 1,
        pose_shift: -1,
        ..Correction::default()
    };
    let corrected = apply(correction, &original);
    let pairs: Vec<_> = corrected
        .sources
        .iter()
        .map(|s| (s.image, s.mask))
        .collect();
    assert_eq!(pairs, [(11, 12), (12, 13)]);
    assert_eq!(corrected.track.frames[0].pose, original.frames[0].pose);
    assert_eq!(corrected.track.frames[0].index, 11);
    let far = Correction {
        mask_shift: -4,
        ..Correction::default()
    };
    let error = far.apply(&original).expect_err("no frame is left");
    assert!(error.to_string().contains("-4 leaves none of 4"), "{error}");
}

#[test]
fn a_body_with_one_arm_has_no_mirror_image() {
    let mut track = track(1);
    track.skeleton.rest_joints[2] = [0.4, 0.2, 0.0];
    let correction = Correction {
        mirror: Mirror::Poses,
        ..Correction::default()
    };
    let error = correction.apply(&track).expect_err("not symmetric");
    assert!(error.to_string().contains("rest_joints["), "{error}");
}
