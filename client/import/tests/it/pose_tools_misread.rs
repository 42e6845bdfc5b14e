//! Numbers of pose tools that mean something else than the tool documents: masks tell, and it is said.

use crate::pose_tools::{files, import, indices, options, truth};
use crate::pose_tools_made::{all, lands, lhm, refused, steps, wham};
use crate::{npz, pickled};
use serde_json::{Value, json};
use yoto_capture::skeleton::transform::rodrigues;
use yoto_import::{Format, Options, read};

/// How far a body is beside the masks, metres.
const ASIDE: f64 = 0.08;

#[test]
fn a_translation_of_the_other_meaning_is_found_by_the_masks() {
    let dir = tempfile::tempdir().expect("a folder");
    let pelvis = truth().rest_joints[0];
    // Th = t + J0 − R J0, written where t belongs.
    let path = wham(dir.path(), &all(), |person| {
        for frame in 0..16 {
            let angle = |i: usize| person["pose"][frame][i].as_f64().expect("a number");
            let r = rodrigues([angle(0), angle(1), angle(2)]);
            for axis in 0..3 {
                let turned: f64 = (0..3).map(|i| r[axis][i] * pelvis[i]).sum();
                let t = person["trans"][frame][axis].as_f64().expect("a number");
                person["trans"][frame][axis] = (t + pelvis[axis] - turned).into();
            }
        }
    });
    let found = import(&options(dir.path(), path));
    lands(&found);
    let notes = found.notes.join("\n");
    assert!(
        notes.contains("not as WHAM documents") && notes.contains("as EasyMocap's Th"),
        "{notes}"
    );
}

#[test]
fn a_wrong_focal_length_is_found_by_the_masks() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = lhm(dir.path(), |frame| {
        for axis in 0..2 {
            let focal = frame["focal"][axis].as_f64().expect("a number");
            frame["focal"][axis] = (1.6 * focal).into();
        }
    });
    let found = import(&options(dir.path(), path));
    lands(&found);
    let notes = found.notes.join("\n");
    assert!(
        notes.contains("not as LHM documents: the focal length √(W²+H²)"),
        "{notes}"
    );
}

#[test]
fn poses_a_frame_late_are_found_by_the_masks() {
    let dir = tempfile::tempdir().expect("a folder");
    let clip = steps(dir.path());
    let shifted = |by: usize| {
        let path = wham(dir.path(), &[0, 4, 8], |person| {
            person["frame_ids"] = json!([by, by + 1, by + 2]);
        });
        let options = Options {
            masks: Some(clip.join("masks")),
            ..options(dir.path(), path)
        };
        read(Format::AUTO, &clip.join("frames"), &options).expect("imports")
    };
    let (right, late) = (shifted(0), shifted(1));
    assert!(
        right.notes.join("\n").contains("read as WHAM documents"),
        "{:?}",
        right.notes
    );
    let notes = late.notes.join("\n");
    assert!(notes.contains("a frame earlier than its number"), "{notes}");
    assert_eq!(indices(&late.track), [0, 1, 2]);
    assert_eq!(right.track, late.track);
}

#[test]
fn a_person_beside_the_masks_is_not_taken_for_being_seen_longer() {
    let dir = tempfile::tempdir().expect("a folder");
    let body = &truth().people[0];
    let seen = |frames: std::ops::Range<usize>, aside: f64| {
        let t = body.t[frames.clone()].iter();
        let t: Vec<[f64; 3]> = t.map(|[x, y, z]| [x + aside, *y, *z]).collect();
        json!({"pose": body.poses[frames.clone()], "trans": t, "betas": [vec![0.0; 10]],
            "frame_ids": frames.collect::<Vec<_>>()})
    };
    let path = dir.path().join("wham_output.pkl");
    let taken = |people: Value| {
        pickled::write(&path, &people);
        let found = import(&options(dir.path(), path.clone()));
        let notes = found.notes.join("\n");
        (notes, indices(&found.track))
    };
    // The one beside agrees to 65 %, in twice as many frames; the person to 95 %.
    let (notes, frames) = taken(json!({"1": seen(0..16, ASIDE), "2": seen(3..11, 0.0)}));
    assert!(notes.contains("person 2 is taken (8 frames)"), "{notes}");
    assert_eq!(frames, (3..11).collect::<Vec<_>>());
    // One person under two numbers, one after the other.
    let (notes, frames) = taken(json!({"1": seen(0..4, 0.0), "2": seen(6..16, 0.0)}));
    assert!(
        notes.contains("person 1 goes on as 2 (3 frames later"),
        "{notes}"
    );
    assert_eq!(frames, (0..4).chain(6..16).collect::<Vec<_>>());
    // Both numbers are in the file, so each of them names the person.
    let named = |id: &str| Options {
        person: Some(id.to_owned()),
        ..options(dir.path(), path.clone())
    };
    assert_eq!(indices(&import(&named("2")).track), frames);
    let error = read(Format::AUTO, &files("clip/frames"), &named("7"));
    let error = error.expect_err("nobody has the number").to_string();
    assert!(
        error.contains("there is no person 7; there are 1, 2"),
        "{error}"
    );
    // Somebody else appears elsewhere.
    let (notes, _) = taken(json!({"1": seen(0..4, 2.0), "2": seen(6..16, 0.0)}));
    assert!(notes.contains("person 2 is taken (10 frames)"), "{notes}");
}

#[test]
fn exchanged_sides_are_refused_by_name() {
    let dir = tempfile::tempdir().expect("a folder");
    let body = &truth().people[0];
    let mirror = |joints: &[[f64; 3]]| {
        let pairs = [
            (1, 2),
            (4, 5),
            (7, 8),
            (10, 11),
            (13, 14),
            (16, 17),
            (18, 19),
            (20, 21),
            (22, 23),
        ];
        let mut joints = joints.to_vec();
        pairs
            .iter()
            .for_each(|&(left, right)| joints.swap(left, right));
        joints.resize(71, [0.0; 3]);
        joints
    };
    let mut frames = serde_json::Map::new();
    for frame in 0..16 {
        let results = json!({"smpl_thetas": [body.poses[frame]], "smpl_betas": [vec![0.0; 10]],
            "cam_trans": [body.t[frame]], "joints": [mirror(&body.joints[frame])], "track_ids": [0]});
        frames.insert(format!("{frame:06}.png"), results);
    }
    let path = dir.path().join("video_results.pkl");
    pickled::write(&path, &json!({ "results": frames }));
    let options = Options {
        rest_joints: None,
        ..options(dir.path(), path)
    };
    let text = refused(&files("clip/frames"), &options);
    assert!(
        text.contains("video_results.pkl: the left hip is on the person's right"),
        "{text}"
    );
}

/// GVHMR's values with flat names, as nodes of ComfyUI write them: those of the camera are a capture.
#[test]
fn flat_names_of_gvhmr_are_its_camera_s_values() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("walk.npz");
    let body = &truth().people[0];
    let orient: Vec<f64> = body
        .poses
        .iter()
        .flat_map(|pose| pose[..3].to_vec())
        .collect();
    let rest: Vec<f64> = body
        .poses
        .iter()
        .flat_map(|pose| pose[3..66].to_vec())
        .collect();
    let places: Vec<f64> = body.t.iter().flatten().copied().collect();
    for [orient_name, place_name] in [
        ["global_orient_incam", "transl_incam"],
        [
            "smpl_params_incam_global_orient",
            "smpl_params_incam_transl",
        ],
    ] {
        npz::write(
            &path,
            &[
                ("body_pose", &[16, 63], &rest),
                ("betas", &[16, 10], &[0.0; 160]),
                (orient_name, &[16, 3], &orient),
                (place_name, &[16, 3], &places),
                ("global_orient", &[16, 3], &[0.0; 48]),
                ("transl", &[16, 3], &[1.0; 48]),
            ],
        );
        let found = read(
            Format::AUTO,
            &files("clip/frames"),
            &Options {
                masks: None,
                ..options(dir.path(), path.clone())
            },
        );
        let found = found.expect("imports");
        let notes = found.notes.join("; ");
        assert!(notes.contains("GVHMR: 1 person, 16 frames"), "{notes}");
        for (frame, wanted) in found.track.frames.iter().zip(&body.poses) {
            let off = frame
                .pose
                .iter()
                .zip(&wanted[..66])
                .map(|(a, b)| (a - b).abs());
            assert!(off.fold(0.0, f64::max) < 1e-5, "{:?}", frame.index);
        }
    }
}
