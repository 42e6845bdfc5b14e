//! Refusals name what the user gave, say what it is, and are short.

use crate::pose_tools::files;
use crate::{npz, pickled};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use yoto_import::motion::MotionOptions;
use yoto_import::{Format, Options, read};

fn refused(path: &Path) -> String {
    let options = Options {
        poses: Some(path.to_owned()),
        ..Options::default()
    };
    let done = read(Format::AUTO, &files("clip/frames"), &options);
    let message = done
        .map(|found| found.notes)
        .expect_err("refused")
        .to_string();
    assert!(
        message.contains(&path.display().to_string()),
        "the file is named: {message}"
    );
    assert!(
        message.len() < 700,
        "{} characters: {message}",
        message.len()
    );
    message
}

fn pickle(dir: &Path, name: &str, value: &Value) -> PathBuf {
    let path = dir.join(name);
    pickled::write(&path, value);
    path
}

#[test]
fn a_file_in_the_wrong_place_is_known() {
    let dir = tempfile::tempdir().expect("a folder");
    let of = |name: &str, value: &Value| refused(&pickle(dir.path(), name, value));
    let boxes = json!({"bbx_xyxy": [[0.0, 0.0, 1.0, 1.0]], "bbx_xys": [[0.0, 0.0, 1.0]]});
    let text = of("bbx.pt", &boxes);
    assert!(
        text.contains("GVHMR's file of boxes; its poses are in hmr4d_results.pt"),
        "{text}"
    );
    // WHAM writes joblib's files under torch's ending.
    let tracks = json!({"0": {"keypoints": [[1.0]], "bbox": [[1.0]], "frame_id": [0.0]}});
    let text = of("tracking_results.pth", &tracks);
    assert!(text.contains("wham_output.pkl"), "{text}");
    let text = of(
        "slam_results.pth",
        &json!([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]]),
    );
    assert!(
        text.contains("path of a camera") && text.contains("[1, 7]"),
        "{text}"
    );
    let text = of("stuff.pkl", &json!({"boxes": [[1.0, 2.0]], "who": "me"}));
    assert!(
        text.contains("it holds boxes [1, 2], who text") || text.contains("who text"),
        "{text}"
    );
    for wanted in ["GVHMR", "OpenPose", "MediaPipe", ".bvh"] {
        assert!(text.contains(wanted), "{text}");
    }
    let motion = dir.path().join("walk.npz");
    npz::write(
        &motion,
        &[
            ("poses", &[2, 156], &[0.0; 312]),
            ("trans", &[2, 3], &[0.0; 6]),
        ],
    );
    let text = refused(&motion);
    assert!(
        text.contains("this is a motion") && text.contains("--motion-file"),
        "{text}"
    );
    let markers = dir.path().join("walk.trc");
    std::fs::write(&markers, "PathFileType").expect("writes");
    let text = refused(&markers);
    assert!(text.contains("OpenSim"), "{text}");
}

#[test]
fn a_file_beside_the_given_one_is_not_blamed() {
    let dir = tempfile::tempdir().expect("a folder");
    npz::write(
        &dir.path().join("other.npz"),
        &[("poses", &[2, 156], &[0.0; 312])],
    );
    let given = dir.path().join("sam3d_view1.npz");
    let write = |coords: &[f64], people: usize| {
        npz::write(
            &given,
            &[
                (
                    "frame_idx",
                    &[people],
                    &(0..people).map(|at| at as f64).collect::<Vec<_>>(),
                ),
                ("pred_joint_coords", &[people, 127, 3], coords),
                ("pred_cam_t", &[people, 3], &[0.0, 0.0, 3.0].repeat(people)),
                ("focal_length", &[people], &vec![100.0; people]),
            ],
        );
    };
    // All joints on one spot: no body has them.
    write(&[0.0; 2 * 127 * 3], 2);
    let text = refused(&given);
    assert!(
        !text.contains("other.npz") && !text.contains("number of a frame"),
        "{text}"
    );
    // The frames of a person in one file, as the script's files frame by frame, less those whose first person is another.
    let mut coords = Vec::new();
    let (mut shifts, mut frames) = (Vec::new(), Vec::new());
    for frame in (0..16).filter(|frame| ![3, 5, 7, 9, 11].contains(frame)) {
        let path = files(&format!("sam_3d_body/frame_{frame:04}_subj00.npz"));
        let bytes = std::fs::read(&path).expect("a file");
        let value = yoto_formats::npz::read(&bytes, 1 << 24).expect("an npz");
        let numbers = |name: &str| {
            value
                .get(name)
                .and_then(|it| it.numbers())
                .expect(name)
                .values
        };
        coords.extend(numbers("pred_joint_coords"));
        shifts.extend(numbers("pred_cam_t"));
        frames.push(frame as f64);
    }
    npz::write(
        &given,
        &[
            ("frame_idx", &[11], &frames),
            ("pred_joint_coords", &[11, 127, 3], &coords),
            ("pred_cam_t", &[11, 3], &shifts),
        ],
    );
    let found = crate::key_points::import(&crate::key_points::options(given));
    assert_eq!(found.track.frames.len(), 11, "{:?}", found.notes);
    let off = crate::key_points::off(&found, 0);
    assert!(off < 3.0, "{off} px; {:?}", found.notes);
}

#[test]
fn what_is_no_motion_gets_a_hint() {
    let dir = tempfile::tempdir().expect("a folder");
    let refused = |path: &Path| {
        let read = yoto_import::read_motion(path, &MotionOptions::default());
        read.expect_err("refused").to_string()
    };
    let trc = dir.path().join("a.trc");
    std::fs::write(&trc, "").expect("writes");
    assert!(refused(&trc).contains("OpenSim"), "{}", refused(&trc));
    let text = refused(&files("gvhmr/outputs/demo/walk/hmr4d_results.pt"));
    assert!(text.contains("yoto import CLIP --poses"), "{text}");
    let text = refused(&files("mediapipe/landmarks.json"));
    assert!(
        text.contains("key points") && text.contains("yoto import CLIP --poses"),
        "{text}"
    );
}
