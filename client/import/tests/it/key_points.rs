//! Files of detectors of key points, against the joints that the script that wrote them knows
//! (`tests/formats/pose_tools`), and files that are wrong.

use serde::Deserialize;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;
use yoto_import::{Format, Imported, Options, Pictures, TrackForm, read, write};

/// What the script says.
#[derive(Deserialize)]
struct Truth {
    people: Vec<Body>,
    second_seen: Vec<usize>,
}

#[derive(Deserialize)]
struct Body {
    /// `[16][24]`, counted from the first pixel's centre.
    pixels: Vec<Vec<[f64; 2]>>,
}

/// Joints that detectors see: knees, ankles, shoulders, elbows, wrists.
const SEEN: [usize; 10] = [4, 5, 7, 8, 16, 17, 18, 19, 20, 21];

pub(crate) fn files(name: &str) -> PathBuf {
    crate::captures("../pose_tools/captures").join(name)
}

fn truth() -> Truth {
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
    read(Format::KeyPoints, &files("clip/frames"), options).expect("imports")
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
const DETECTORS: [(&str, &str, bool); 7] = [
    ("openpose", "OpenPose", true),
    ("alphapose/alphapose-results.json", "AlphaPose", true),
    ("mmpose/results_walk.json", "MMPose", true),
    ("mediapipe/landmarks.npz", "MediaPipe", false),
    ("mediapipe/landmarks.json", "MediaPipe", false),
    ("mediapipe/landmarks.csv", "MediaPipe", false),
    ("sam_3d_body", "SAM 3D Body", true),
];

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
        let found = read(Format::Auto, &files("clip/frames"), &options(files(path)));
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
        let refused = read(Format::KeyPoints, &files("clip/frames"), &absent);
        let message = refused.expect_err("nobody").to_string();
        assert!(
            message.contains("there is no person nobody; there are"),
            "{message}"
        );
    }
}

#[test]
fn masks_are_the_person_s_own() {
    for (person, colour) in [("1", "#800000"), ("2", "#008000")] {
        let masked = Options {
            person: Some(person.into()),
            masks: Some(files("clip/masks")),
            ..options(files("alphapose/alphapose-results.json"))
        };
        let found = import(&masked);
        let notes = found.notes.join("\n");
        assert!(notes.contains(colour), "{person}: {notes}");
        let Pictures::Files(pictures) = &found.pictures else {
            panic!("the clip is a folder of pictures");
        };
        assert_eq!(pictures.len(), found.track.frames.len());
        assert!(pictures.iter().all(|picture| picture.masks.len() == 1));
    }
    let unmasked = import(&options(files("alphapose/alphapose-results.json")));
    assert!(unmasked.notes.iter().any(|note| note.contains("--masks")));
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

#[test]
fn masks_of_another_person_are_refused_and_gaps_are_said() {
    let dir = tempfile::tempdir().expect("a folder");
    for frame in 0..16 {
        let aside = |x: u32, y: u32| image::Luma([if x > 54 && y < 30 { 255 } else { 0 }]);
        let mask = image::GrayImage::from_fn(64, 96, aside);
        let path = dir.path().join(format!("{frame:06}.png"));
        mask.save(path).expect("writes");
    }
    for (path, name, has_both) in DETECTORS {
        let others = Options {
            masks: Some(dir.path().to_owned()),
            ..options(files(path))
        };
        let refused = read(Format::KeyPoints, &files("clip/frames"), &others);
        let message = refused
            .map(|found| found.notes)
            .expect_err(name)
            .to_string();
        assert!(
            message.contains("most of the key points lie outside the masks"),
            "{path}: {message}"
        );
        if has_both {
            let second = Options {
                person: Some(if path.contains("alphapose") { "2" } else { "1" }.into()),
                ..options(files(path))
            };
            let notes = import(&second).notes.join("\n");
            assert!(
                notes.contains("7 frames without key points of the person (0–2, 12–15)"),
                "{path}: {notes}"
            );
        }
    }
}

/// AlphaPose's list, spoiled.
fn spoiled(dir: &Path, spoil: impl FnOnce(&mut Value)) -> PathBuf {
    let text = std::fs::read(files("alphapose/alphapose-results.json")).expect("a file");
    let mut list: Value = serde_json::from_slice(&text).expect("JSON");
    spoil(&mut list);
    let path = dir.join("alphapose-results.json");
    std::fs::write(&path, list.to_string()).expect("writes");
    path
}

/// A hand of 21 points that is bent at the wrist by 90° in the picture: x, y and confidence.
fn bent_hand(elbow: [f64; 2], wrist: [f64; 2]) -> Vec<[f64; 3]> {
    let arm = [wrist[0] - elbow[0], wrist[1] - elbow[1]];
    let at = |along: f64, across: f64| {
        let x = wrist[0] + along * arm[1] + across * arm[0];
        [x, wrist[1] - along * arm[0] + across * arm[1], 0.9]
    };
    let mut hand = vec![at(0.0, 0.0); 21];
    (hand[2], hand[5], hand[17]) = (at(0.2, -0.15), at(0.35, -0.1), at(0.33, 0.1));
    hand
}

/// Flat x, y and confidence of both hands of a person, from COCO's points.
fn bent_hands(body: &[[f64; 2]]) -> [Vec<[f64; 3]>; 2] {
    [(7, 9), (8, 10)].map(|(elbow, wrist)| bent_hand(body[elbow], body[wrist]))
}

/// Angle between forearm and hand in the pictures, degrees: the mean of both sides and all frames.
fn bend(found: &Imported) -> f64 {
    let track = &found.track;
    let skeleton = Skeleton::from_track(&track.skeleton).expect("a skeleton");
    let mut bends = Vec::new();
    for frame in &track.frames {
        let pose = Pose::from_frame(frame).expect("a pose");
        let camera = Camera::from_frame(frame, track.image_size).expect("a camera");
        let joints = skeleton.posed_joints(&pose);
        let at = |joint: usize| camera.project(joints[joint]).expect("in front");
        let way = |from: usize, to: usize| {
            let (a, b) = (at(from), at(to));
            (b[1] - a[1]).atan2(b[0] - a[0]).to_degrees()
        };
        bends.extend([18, 19].map(|elbow| {
            let by = way(elbow + 2, elbow + 4) - way(elbow, elbow + 2);
            180.0 - ((by.abs() % 360.0) - 180.0).abs()
        }));
    }
    bends.iter().sum::<f64>() / bends.len() as f64
}

#[test]
fn hands_of_full_body_sets_bend_the_wrist() {
    let dir = tempfile::tempdir().expect("a folder");
    let pairs = |values: &Value| -> Vec<[f64; 2]> {
        let values: Vec<f64> = serde_json::from_value(values.clone()).expect("numbers");
        let points = values.chunks_exact(3);
        points.map(|point| [point[0], point[1]]).collect()
    };
    // Halpe's 136 points: 26 of the body, 68 of the face, the hands.
    let halpe = spoiled(dir.path(), |list| {
        for person in list.as_array_mut().expect("people") {
            let body = person["keypoints"].clone();
            let mut points: Vec<f64> = serde_json::from_value(body.clone()).expect("numbers");
            points.resize(3 * 94, 0.0);
            points.extend(bent_hands(&pairs(&body)).concat().concat());
            person["keypoints"] = json!(points);
        }
    });
    // COCO-WholeBody's 133: 17, 6 of the feet, 68 of the face, the hands.
    let text = std::fs::read(files("mmpose/results_walk.json")).expect("a file");
    let mut whole: Value = serde_json::from_slice(&text).expect("JSON");
    for frame in whole["instance_info"].as_array_mut().expect("frames") {
        for person in frame["instances"].as_array_mut().expect("people") {
            let mut points: Vec<[f64; 2]> =
                serde_json::from_value(person["keypoints"].clone()).expect("points");
            let hands = bent_hands(&points).concat();
            points.resize(91, [0.0; 2]);
            points.extend(hands.iter().map(|&[x, y, _]| [x, y]));
            let mut scores: Vec<f64> =
                serde_json::from_value(person["keypoint_scores"].clone()).expect("scores");
            scores.resize(91, 0.0);
            scores.resize(133, 0.9);
            person["keypoints"] = json!(points);
            person["keypoint_scores"] = json!(scores);
        }
    }
    let coco = dir.path().join("results_whole.json");
    std::fs::write(&coco, whole.to_string()).expect("writes");
    // OpenPose's files of hands beside its 25 points.
    let openpose = dir.path().join("openpose");
    std::fs::create_dir(&openpose).expect("a folder");
    for file in std::fs::read_dir(files("openpose")).expect("a folder") {
        let file = file.expect("a file").path();
        let text = std::fs::read(&file).expect("a file");
        let mut frame: Value = serde_json::from_slice(&text).expect("JSON");
        for person in frame["people"].as_array_mut().expect("people") {
            let body = pairs(&person["pose_keypoints_2d"]);
            let [left, right] =
                [(6, 7), (3, 4)].map(|(elbow, wrist)| bent_hand(body[elbow], body[wrist]));
            person["hand_left_keypoints_2d"] = json!(left.concat());
            person["hand_right_keypoints_2d"] = json!(right.concat());
        }
        let out = openpose.join(file.file_name().expect("a name"));
        std::fs::write(out, frame.to_string()).expect("writes");
    }
    for (with, without) in [
        (halpe, "alphapose/alphapose-results.json"),
        (coco, "mmpose/results_walk.json"),
        (openpose, "openpose"),
    ] {
        let bare = bend(&import(&options(files(without))));
        let bent = bend(&import(&options(with)));
        assert!(bare < 20.0 && bent > 50.0, "{without}: {bare}° and {bent}°");
    }
}

/// The same people as easy_ViTPose writes them: y before x, names by index.
#[test]
fn sam_3d_body_s_own_masks_are_taken() {
    let found = import(&options(files("sam_3d_body")));
    let notes = found.notes.join("\n");
    assert!(notes.contains("the detector's own"), "{notes}");
    let dir = tempfile::tempdir().expect("a folder");
    let out = dir.path().join("out");
    write(&found, &out, TrackForm::Json, |_, _, _| {}).expect("writes");
    let palette = image::open(files("clip/masks/00007.png")).expect("a mask");
    let mask = image::open(out.join("masks/000007.png")).expect("a mask");
    // The first person is in front, so that the palette's picture has all of them.
    for (pixel, colour) in mask.into_luma8().pixels().zip(palette.into_rgb8().pixels()) {
        assert_eq!(pixel.0[0] == 255, colour.0 == [128, 0, 0]);
    }
    let given = Options {
        masks: Some(files("clip/masks")),
        ..options(files("sam_3d_body"))
    };
    let notes = import(&given).notes.join("\n");
    assert!(!notes.contains("the detector's own"), "{notes}");
}

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
        let refused = read(Format::KeyPoints, &files("clip/frames"), &options(poses));
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
        Format::KeyPoints,
        &files("clip/frames"),
        &Options::default(),
    );
    let message = alone.expect_err("no points").to_string();
    assert!(message.contains("--poses"), "{message}");
}
