//! Motions of other programs, against where the script that wrote them says joints stand.

use crate::{captures, expected, npz};
use std::collections::HashMap;
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::Skeleton;
use yoto_import::motion::{Motion, MotionOptions, Up, read};
use yoto_synthetic::SyntheticPerson;

type Vec3 = [f64; 3];

/// Where the joints of frame `at` stand.
fn posed(motion: &Motion, at: usize) -> Vec<Vec3> {
    let skeleton = Skeleton::from_track(&motion.skeleton).expect("a skeleton");
    let frame = &motion.frames[at];
    let rest = motion.skeleton.rest_joints[0];
    let pose = Pose {
        rotations: frame
            .rotations
            .iter()
            .map(|r| r.map(|v| v as f32))
            .collect(),
        translation: std::array::from_fn(|i| (frame.root[i] - rest[i]) as f32),
    };
    skeleton.posed_joints(&pose)
}

fn distance(a: Vec3, b: Vec3) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

fn direction(from: Vec3, to: Vec3) -> Vec3 {
    std::array::from_fn(|i| (to[i] - from[i]) / distance(from, to))
}

#[test]
fn a_pose_track_keeps_the_time_of_frames_that_were_left_out() {
    let (mut track, _) = SyntheticPerson::cast(1, 7)[0].capture(4, 32);
    let dir = tempfile::tempdir().expect("a folder");
    for (numbers, frames, rate) in [([0, 2, 4, 6], 4, 0.5), ([0, 1, 4, 6], 7, 1.0)] {
        for (frame, number) in track.frames.iter_mut().zip(numbers) {
            frame.index = number;
        }
        let path = dir.path().join("walk.pb");
        std::fs::write(&path, track.to_binary()).expect("writes");
        let motion = read(&path, &MotionOptions::default()).expect("reads");
        assert_eq!(motion.frames.len(), frames);
        assert!(
            (motion.fps / track.fps - rate).abs() < 1e-9,
            "{}",
            motion.fps
        );
    }
}

#[test]
fn amass_stands_up() {
    let options = MotionOptions {
        body_model: Some(captures("smpl/model.npz")),
        ..MotionOptions::default()
    };
    let motion = read(&captures("amass/walk_poses.npz"), &options).expect("reads");
    assert_eq!(motion.fps, 120.0);
    let wanted: Vec<Vec<Vec3>> = serde_json::from_value(expected("amass")).expect("places");
    assert_eq!(motion.frames.len(), wanted.len());
    for (at, wanted) in wanted.iter().enumerate() {
        for (joint, (found, wanted)) in posed(&motion, at).iter().zip(wanted).enumerate() {
            let off = distance(*found, *wanted);
            assert!(off < 1e-5, "frame {at} joint {joint}: {off} m");
        }
    }
    // Only 72 numbers a pose and no rate: which axis is up is seen from the person, unless the user says it.
    let bare = captures("amass/bare.npz");
    let standing = read(&bare, &options).expect("reads");
    let lying = MotionOptions {
        up: Some(Up::Y),
        ..options
    };
    let lying = read(&bare, &lying).expect("reads");
    assert_ne!(lying.frames, standing.frames);
    for (a, b) in standing.frames.iter().zip(&motion.frames) {
        assert!(distance(a.rotations[0], b.rotations[0]) < 1e-5);
    }
    let unknown = read(&bare, &MotionOptions::default()).expect("reads");
    assert!(unknown.skeleton.rest_joints.is_empty());
    assert_eq!(unknown.clip(1, 9, 2, 64).poses.len(), 2);
}

#[test]
fn bvh_limbs_point_where_the_file_s_do() {
    let path = captures("bvh/mixamo.bvh");
    let motion = read(&path, &MotionOptions::default()).expect("reads");
    assert!((motion.fps - 30.0).abs() < 1e-3);
    assert_eq!(motion.unmatched, ["Prop_Bag"]);
    assert_eq!(motion.matched.len(), 22);
    let names: HashMap<&str, &str> = motion
        .matched
        .iter()
        .map(|(joint, name)| (joint.as_str(), name.as_str()))
        .collect();
    assert_eq!(names["l_collar"], "mixamorig:LeftShoulder");
    assert_eq!(names["spine3"], "mixamorig:Spine2");
    // The file's arms hang; ours are level at rest, and the file's lengths are kept.
    let rest = |name: &str| {
        let at = motion.skeleton.names.iter().position(|other| other == name);
        motion.skeleton.rest_joints[at.expect("is there")]
    };
    let arm = direction(rest("l_shoulder"), rest("l_elbow"));
    assert!(distance(arm, [1.0, 0.0, 0.0]) < 1e-9, "{arm:?}");
    assert!((distance(rest("l_shoulder"), rest("l_elbow")) - 800f64.sqrt()).abs() < 1e-9);

    let wanted: Vec<HashMap<String, Vec3>> =
        serde_json::from_value(expected("bvh")).expect("places");
    for (at, wanted) in wanted.iter().enumerate() {
        // Bones keep length and direction, so that every joint stands where the file's does.
        for (name, found) in motion.skeleton.names.iter().zip(posed(&motion, at)) {
            let off = distance(found, wanted[names[name.as_str()]]);
            assert!(off < 1e-3, "frame {at} {name}: {off} cm");
        }
    }
}

#[test]
fn maps_can_be_edited_and_must_know_the_root() {
    let dir = tempfile::tempdir().expect("a folder");
    let map = dir.path().join("map.json");
    let with = |text: &str| {
        std::fs::write(&map, text).expect("writes");
        let options = MotionOptions {
            joint_map: Some(map.clone()),
            ..MotionOptions::default()
        };
        read(&captures("bvh/mixamo.bvh"), &options)
    };
    let few = with(r#"{"pelvis": "Hips", "tail": ["Prop_Bag"], "head": ["Head"]}"#).expect("reads");
    assert_eq!(few.skeleton.names, ["pelvis", "head", "tail"]);
    // What is between the root and the head is folded into it.
    assert_eq!(few.skeleton.parents, [-1, 0, 0]);
    let wanted: Vec<HashMap<String, Vec3>> =
        serde_json::from_value(expected("bvh")).expect("places");
    assert!(distance(posed(&few, 1)[0], wanted[1]["mixamorig:Hips"]) < 1e-3);

    let error = with(r#"{"head": ["Head"]}"#)
        .expect_err("no root")
        .to_string();
    assert!(
        error.contains("mixamo.bvh: ROOT: its root 'mixamorig:Hips'"),
        "{error}"
    );
    let error = with("[]").expect_err("no map").to_string();
    assert!(error.contains("map.json"), "{error}");
}

/// Values of GVHMR in one file: those of the world are read, at the file's own rate.
#[test]
fn parameters_of_smplx_have_21_joints_and_a_rate_of_any_name() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("tennis.npz");
    let mut body = vec![0.0; 2 * 63];
    // The left knee of the second frame, which is joint 4.
    body[63 + 3 * 3] = 0.7;
    npz::write(
        &path,
        &[
            ("body_pose", &[2, 63], &body),
            ("betas", &[2, 10], &[0.0; 20]),
            ("global_orient", &[2, 3], &[0.0; 6]),
            ("transl", &[2, 3], &[0.0, 1.3, 0.0, 0.0, 1.3, 0.5]),
            ("global_orient_incam", &[2, 3], &[3.0; 6]),
            ("transl_incam", &[2, 3], &[4.0; 6]),
            ("frameRate", &[], &[60.0]),
        ],
    );
    let motion = read(&path, &MotionOptions::default()).expect("is a motion");
    assert_eq!((motion.fps, motion.frames.len()), (60.0, 2));
    let knee = motion.frames[1].rotations[4];
    assert!((knee[0] - 0.7).abs() < 1e-6, "{knee:?}");
    let step = motion.frames[1].root[2] - motion.frames[0].root[2];
    assert!((step - 0.5).abs() < 1e-6, "{step}");
}

#[test]
fn broken_motions_are_named() {
    let dir = tempfile::tempdir().expect("a folder");
    let fault = |name: &str, bytes: &[u8]| {
        let path = dir.path().join(name);
        std::fs::write(&path, bytes).expect("writes");
        let read = read(&path, &MotionOptions::default());
        read.expect_err(name).to_string()
    };
    let text = fault("a.bvh", b"HIERARCHY\nROOT a\n{\n OFFSET 0 x 0\n");
    assert!(
        text.contains("a.bvh: line 4: OFFSET: 'x' is not a number"),
        "{text}"
    );
    let text = fault("a.npz", b"PK");
    assert!(
        text.contains("a.npz") && text.contains(".npz archive"),
        "{text}"
    );
    let text = fault("a.fbx", b"");
    assert!(text.contains("'.fbx' is not a motion format"), "{text}");
    let text = fault("a.json", b"{");
    assert!(text.contains("at line 1"), "{text}");
}
