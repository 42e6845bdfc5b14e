//! Files of detectors of key points, against the joints that the script that wrote them knows
//! (`tests/formats/pose_tools`), and files that are wrong.

use crate::format;
use serde::Deserialize;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;
use yoto_import::{Format, Imported, Options, key_point_detectors, read};

/// What the script says.
#[derive(Deserialize)]
pub(crate) struct Truth {
    pub(crate) people: Vec<Body>,
    second_seen: Vec<usize>,
}

#[derive(Deserialize)]
pub(crate) struct Body {
    /// `[16][24]`, counted from the first pixel's centre.
    pub(crate) pixels: Vec<Vec<[f64; 2]>>,
}

/// Joints that detectors see: knees, ankles, shoulders, elbows, wrists.
const SEEN: [usize; 10] = [4, 5, 7, 8, 16, 17, 18, 19, 20, 21];

pub(crate) fn files(name: &str) -> PathBuf {
    crate::captures("../pose_tools/captures").join(name)
}

pub(crate) fn truth() -> Truth {
    let text = std::fs::read(files("expected.json")).expect("the script's figures");
    serde_json::from_slice(&text).expect("JSON")
}

pub(crate) fn options(poses: PathBuf) -> Options {
    Options {
        poses: Some(poses),
        fps: Some(25.0),
        ..Options::default()
    }
}

pub(crate) fn import(options: &Options) -> Imported {
    read(format("key-points"), &files("clip/frames"), options).expect("imports")
}

pub(crate) fn indices(found: &Imported) -> Vec<usize> {
    let frames = found.track.frames.iter();
    frames.map(|frame| frame.index as usize).collect()
}

/// The mean distance of joints' pixels from those of person `who`.
pub(crate) fn off(found: &Imported, who: usize) -> f64 {
    let (truth, track) = (truth(), &found.track);
    let skeleton = Skeleton::from_track(&track.skeleton).expect("a skeleton");
    let (mut sum, mut count) = (0.0, 0.0);
    for frame in &track.frames {
        let pose = Pose::from_frame(frame).expect("a pose");
        let camera = Camera::from_frame(frame, track.image_size).expect("a camera");
        let joints = skeleton.posed_joints(&pose);
        for joint in SEEN {
            let seen = camera
                .project(joints[joint])
                .expect("in front of the camera");
            let [u, v] = truth.people[who].pixels[frame.index as usize][joint];
            sum += (seen[0] - 0.5 - u).hypot(seen[1] - 0.5 - v);
            count += 1.0;
        }
    }
    sum / count
}

/// Each detector's files, what its note calls it, and whether they hold both people.
pub(crate) const DETECTORS: [(&str, &str, bool); 7] = [
    ("openpose", "OpenPose", true),
    ("alphapose/alphapose-results.json", "AlphaPose", true),
    ("mmpose/results_walk.json", "MMPose", true),
    ("mediapipe/landmarks.npz", "MediaPipe", false),
    ("mediapipe/landmarks.json", "MediaPipe", false),
    ("mediapipe/landmarks.csv", "MediaPipe", false),
    ("sam_3d_body", "SAM 3D Body", true),
];

/// Detectors whose files a test of this page writes.
const WRITTEN: [&str; 1] = ["easy_ViTPose"];

#[test]
fn every_detector_has_files_of_its_own() {
    for name in key_point_detectors() {
        let has_files = DETECTORS.iter().any(|(_, of, _)| *of == name);
        assert!(
            has_files || WRITTEN.contains(&name),
            "DETECTORS lacks {name}"
        );
    }
}

#[test]
fn a_body_is_fitted_to_every_detector_s_points() {
    for (path, name, has_both) in DETECTORS {
        let found = import(&options(files(path)));
        let notes = found.notes.join("\n");
        assert!(notes.starts_with(&format!("{name}: key points")), "{notes}");
        assert!(notes.contains("median error"), "{path}: {notes}");
        assert_eq!(notes.contains("--person"), has_both, "{path}: {notes}");
        assert_eq!(
            indices(&found),
            (0..16).collect::<Vec<_>>(),
            "{path}: {notes}"
        );
        assert_eq!(found.track.image_size, [64, 96]);
        assert!((found.track.fps - 25.0).abs() < 1e-12);
        let off = off(&found, 0);
        assert!(off < 1.5, "{path}: {off} px; {notes}");
    }
}

#[test]
fn key_points_are_recognised() {
    for (path, name, _) in DETECTORS {
        let found = read(Format::AUTO, &files("clip/frames"), &options(files(path)));
        let notes = found.expect("imports").notes.join("\n");
        assert!(
            notes.contains(&format!("{name}: key points")),
            "{path}: {notes}"
        );
    }
}

#[test]
fn the_second_person_is_taken_by_number_or_by_order() {
    for (path, person) in [
        ("alphapose/alphapose-results.json", "2"),
        ("openpose", "1"),
        ("sam_3d_body", "1"),
    ] {
        let second = Options {
            person: Some(person.into()),
            ..options(files(path))
        };
        let found = import(&second);
        assert_eq!(indices(&found), truth().second_seen, "{path}");
        let off = off(&found, 1);
        assert!(off < 1.5, "{path}: {off} px");
        let absent = Options {
            person: Some("nobody".into()),
            ..options(files(path))
        };
        let refused = read(format("key-points"), &files("clip/frames"), &absent);
        let message = refused.expect_err("nobody").to_string();
        assert!(
            message.contains("there is no person nobody; there are"),
            "{message}"
        );
    }
}

#[test]
fn a_range_a_focal_length_and_a_height_are_kept() {
    let told = Options {
        frames: Some((2, 12, 2)),
        focal: Some(120.0),
        height: Some(1.6),
        ..options(files("mediapipe/landmarks.npz"))
    };
    let found = import(&told);
    assert_eq!(indices(&found), [2, 4, 6, 8, 10]);
    let k = found.track.frames[0].k;
    assert!((k[0][0] - 120.0).abs() < 1e-6, "{k:?}");
    let heights = found
        .track
        .skeleton
        .rest_joints
        .iter()
        .map(|joint| joint[1]);
    let span = heights.clone().fold(f64::MIN, f64::max) - heights.fold(f64::MAX, f64::min);
    assert!((1.2..1.6).contains(&span), "{span}");
}

/// AlphaPose's list, spoiled.
pub(crate) fn spoiled(dir: &Path, spoil: impl FnOnce(&mut Value)) -> PathBuf {
    let text = std::fs::read(files("alphapose/alphapose-results.json")).expect("a file");
    let mut list: Value = serde_json::from_slice(&text).expect("JSON");
    spoil(&mut list);
    let path = dir.join("alphapose-results.json");
    std::fs::write(&path, list.to_string()).expect("writes");
    path
}

/// The same people as easy_ViTPose writes them: y before x, names by index.
#[test]
fn easy_vitpose_s_rows_are_read_by_their_names() {
    let text = std::fs::read(files("mmpose/results_walk.json")).expect("a file");
    let given: Value = serde_json::from_slice(&text).expect("JSON");
    let frames = given["instance_info"].as_array().expect("frames").iter();
    let person = |instance: &Value| -> Value {
        let points = instance["keypoints"].as_array().expect("points").iter();
        points
            .map(|point| json!([point[1], point[0], 0.9]))
            .collect()
    };
    let people = |frame: &Value| json!({"7": person(&frame["instances"][0])});
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("walk_result.json");
    let skeleton = &given["meta_info"]["keypoint_id2name"];
    let keypoints: Value = frames.map(people).collect();
    let all = json!({"keypoints": keypoints, "skeleton": skeleton});
    std::fs::write(&path, all.to_string()).expect("writes");
    let found = import(&options(path));
    assert!(
        found.notes[0].starts_with("easy_ViTPose"),
        "{:?}",
        found.notes
    );
    assert_eq!(indices(&found).len(), 16);
    let off = off(&found, 0);
    assert!(off < 1.5, "{off} px");
}

#[test]
fn wrong_files_are_refused_with_their_place() {
    let dir = tempfile::tempdir().expect("a folder");
    let refused = |poses: PathBuf| {
        let refused = read(format("key-points"), &files("clip/frames"), &options(poses));
        refused.expect_err("must be refused").to_string()
    };
    let truncated = |list: &mut Value, from: usize, to: usize| {
        for person in &mut list.as_array_mut().expect("people")[from..to] {
            person["keypoints"]
                .as_array_mut()
                .expect("points")
                .truncate(50);
        }
    };
    let one = import(&options(spoiled(dir.path(), |list| truncated(list, 4, 5))));
    let notes = one.notes.join("\n");
    assert!(
        notes.contains("left out: 1 of ")
            && notes.contains("alphapose-results.json frame")
            && notes.contains("[4].keypoints"),
        "{notes}"
    );
    let message = refused(spoiled(dir.path(), |list| truncated(list, 4, 16)));
    assert!(
        message.contains("alphapose-results.json frame") && message.contains("[4].keypoints"),
        "{message}"
    );
    let message = refused(spoiled(dir.path(), |list| {
        list[0]["image_id"] = json!("900.jpg")
    }));
    assert!(
        message.contains("frame 900") && message.contains("16 frames"),
        "{message}"
    );
    let message = refused(spoiled(dir.path(), |list| {
        for person in list.as_array_mut().expect("people") {
            person["keypoints"] = json!(vec![0.0; 51]);
        }
    }));
    assert!(message.contains("no frame shows a person"), "{message}");
    let far = import(&options(spoiled(dir.path(), |list| {
        list[2]["keypoints"][3] = json!(1e300)
    })));
    let notes = far.notes.join("\n");
    assert!(notes.contains("not finite: 1 points"), "{notes}");
    let message = refused(spoiled(dir.path(), |list| *list = json!({"a": 1})));
    assert!(
        message.contains("it holds a a number. Looked for key points"),
        "{message}"
    );
    let message = refused(dir.path().join("nothing.json"));
    assert!(message.contains("nothing.json"), "{message}");

    let table = dir.path().join("landmarks.csv");
    let cells = |count: usize| vec!["0.5"; count].join(",");
    std::fs::write(&table, format!("0,{}\n1,{}\n", cells(99), cells(98))).expect("writes");
    assert!(
        refused(table.clone()).contains("line 2"),
        "{}",
        refused(table.clone())
    );
    std::fs::write(&table, format!("0,{}\n1,x,{}\n", cells(99), cells(98))).expect("writes");
    assert!(
        refused(table.clone()).contains("line 2"),
        "{}",
        refused(table.clone())
    );
    // All points on one spot.
    std::fs::write(&table, format!("0,{}\n", cells(99))).expect("writes");
    assert!(
        refused(table.clone()).contains("frame 0"),
        "{}",
        refused(table)
    );

    let alone = read(
        format("key-points"),
        &files("clip/frames"),
        &Options::default(),
    );
    let message = alone.expect_err("no points").to_string();
    assert!(message.contains("--poses"), "{message}");
}
