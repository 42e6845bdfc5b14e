//! Key points as browsers, scripts and notebooks write them: read by their shape, their names and their numbers, against
//! the joints that the script knows.

use crate::key_points::{files, import, indices, off, options};
use crate::{npz, pickled};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use yoto_import::{Format, Options, PointSet, read};

/// MediaPipe's landmarks of the first person, x and y in pixels, then depth and visibility: `[16][33][4]`.
fn landmarks() -> Vec<Vec<[f64; 4]>> {
    let text = std::fs::read_to_string(files("mediapipe/landmarks.csv")).expect("a file");
    let row = |line: &str| {
        let numbers = line
            .split(',')
            .skip(1)
            .map(|cell| cell.parse::<f64>().expect("a number"));
        let numbers: Vec<f64> = numbers.collect();
        let point = |p: &[f64]| [p[0] * 64.0, p[1] * 96.0, p[2] - 0.5, p[3]];
        numbers.chunks(4).map(point).collect()
    };
    text.lines()
        .filter(|line| line.starts_with(|c: char| c.is_ascii_digit()))
        .map(row)
        .collect()
}

/// The points of COCO among MediaPipe's, with their names.
const COCO: [(&str, usize); 17] = [
    ("nose", 0),
    ("leftEye", 2),
    ("rightEye", 5),
    ("leftEar", 7),
    ("rightEar", 8),
    ("leftShoulder", 11),
    ("rightShoulder", 12),
    ("leftElbow", 13),
    ("rightElbow", 14),
    ("leftWrist", 15),
    ("rightWrist", 16),
    ("leftHip", 23),
    ("rightHip", 24),
    ("leftKnee", 25),
    ("rightKnee", 26),
    ("leftAnkle", 27),
    ("rightAnkle", 28),
];

fn written(dir: &Path, name: &str, text: &str) -> PathBuf {
    let path = dir.join(name);
    std::fs::write(&path, text).expect("writes");
    path
}

/// Imports `path`, by itself and as told, and checks that the person lands in all frames; the notes.
fn lands(path: PathBuf, said: &str, most: f64) -> String {
    let found = read(Format::AUTO, &files("clip/frames"), &options(path.clone()));
    let found = found.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let notes = found.notes.join("\n");
    assert!(notes.contains(said), "{}: {notes}", path.display());
    assert_eq!(indices(&found), (0..16).collect::<Vec<_>>(), "{notes}");
    let off = off(&found, 0);
    assert!(off < most, "{}: {off} px; {notes}", path.display());
    notes
}

#[test]
fn rows_of_33_points_in_pixels_are_read() {
    let dir = tempfile::tempdir().expect("a folder");
    let rows: Vec<Vec<[f64; 3]>> = landmarks()
        .iter()
        .map(|frame| frame.iter().map(|&[x, y, z, _]| [x, y, z]).collect())
        .collect();
    let notes = lands(
        written(dir.path(), "rows.json", &json!(rows).to_string()),
        "16 frames of 33 points of x, y and depth",
        2.0,
    );
    assert!(notes.contains("blazepose33"), "{notes}");
    let in_a_dictionary = json!({"keypoints": rows}).to_string();
    lands(
        written(dir.path(), "in.json", &in_a_dictionary),
        "33 points",
        2.0,
    );
    let flat: Vec<f64> = rows.iter().flatten().flatten().copied().collect();
    let array = dir.path().join("rows.npz");
    npz::write(&array, &[("points", &[16, 33, 3], &flat)]);
    lands(array, "33 points", 2.0);
    let pickle = dir.path().join("rows.pkl");
    pickled::write(&pickle, &json!(rows));
    lands(pickle, "33 points", 2.0);
}

#[test]
fn dictionaries_by_name_and_by_number_are_read() {
    let dir = tempfile::tempdir().expect("a folder");
    let named = |frame: &Vec<[f64; 4]>| -> Value {
        let point = |(name, at): &(&str, usize)| {
            let [x, y, ..] = frame[*at];
            ((*name).to_owned(), json!({"x": x, "y": y}))
        };
        Value::Object(COCO.iter().map(point).collect())
    };
    let all: Vec<Value> = landmarks().iter().map(named).collect();
    lands(
        written(dir.path(), "named.json", &json!(all).to_string()),
        "coco17",
        2.5,
    );
    // As TensorFlow.js gives them: a list of poses per frame.
    let poses = |frame: &Vec<[f64; 4]>| {
        let point = |(name, at): &(&str, usize)| {
            let [x, y, _, score] = frame[*at];
            json!({"x": x, "y": y, "score": score, "name": name})
        };
        json!([{"score": 0.9, "keypoints": COCO.iter().map(point).collect::<Vec<_>>()}])
    };
    let all: Vec<Value> = landmarks().iter().map(poses).collect();
    lands(
        written(dir.path(), "poses.json", &json!(all).to_string()),
        "coco17",
        2.5,
    );
    let numbered = |frame: &Vec<[f64; 4]>| -> Value {
        let point = |(at, p): (usize, &[f64; 4])| {
            (
                at.to_string(),
                json!({"x": p[0] / 64.0, "y": p[1] / 96.0, "visibility": p[3]}),
            )
        };
        Value::Object(frame.iter().enumerate().map(point).collect())
    };
    let all: serde_json::Map<String, Value> = landmarks()
        .iter()
        .enumerate()
        .map(|(at, frame)| (at.to_string(), numbered(frame)))
        .collect();
    lands(
        written(dir.path(), "numbered.json", &Value::Object(all).to_string()),
        "blazepose33",
        2.0,
    );
}

#[test]
fn a_table_of_a_line_per_landmark_is_read() {
    let dir = tempfile::tempdir().expect("a folder");
    let mut text = "Frame,LandmarkID,X,Y,Z,Visibility\n".to_owned();
    for (frame, points) in landmarks().iter().enumerate() {
        for (at, [x, y, z, sure]) in points.iter().enumerate() {
            // Numbers from 1, and a cell without a number.
            let y = if (frame, at) == (3, 0) {
                String::new()
            } else {
                y.to_string()
            };
            text += &format!("{},{at},{x},{y},{z},{sure}\n", frame + 1);
        }
    }
    let notes = lands(
        written(dir.path(), "long.csv", &text),
        "read as a table",
        2.0,
    );
    assert!(notes.contains("1 to 16, are counted from 1"), "{notes}");
    let mut wide = "frame".to_owned();
    for (name, _) in COCO {
        wide += &format!(",{name}_x,{name}_y,{name}_score");
    }
    for (frame, points) in landmarks().iter().enumerate() {
        wide += &format!("\n{frame}");
        for (_, at) in COCO {
            let [x, y, _, sure] = points[at];
            wide += &format!(",{x},{y},{sure}");
        }
    }
    lands(written(dir.path(), "wide.csv", &wide), "coco17", 2.5);
}

#[test]
fn openpose_s_people_in_a_pickle_are_read() {
    let dir = tempfile::tempdir().expect("a folder");
    let people = |frame: usize| -> Value {
        let name = format!("openpose/walk_{frame:012}_keypoints.json");
        let text = std::fs::read(files(&name)).expect("a file");
        let file: Value = serde_json::from_slice(&text).expect("JSON");
        let person = |person: &Value| json!({"pose_keypoints_2d": person["pose_keypoints_2d"]});
        file["people"]
            .as_array()
            .expect("people")
            .iter()
            .map(person)
            .collect()
    };
    let frames: Vec<Value> = (0..16).map(people).collect();
    let path = dir.path().join("frames.pkl");
    pickled::write(&path, &json!(frames));
    let notes = lands(path, "body25", 2.0);
    assert!(notes.contains("x, y and score"), "{notes}");
}

#[test]
fn a_set_is_told_or_asked_for() {
    let dir = tempfile::tempdir().expect("a folder");
    let halpe = |frame: &Vec<[f64; 4]>| -> Vec<[f64; 2]> {
        let at = |at: usize| [frame[at][0], frame[at][1]];
        let mid = |a: usize, b: usize| [0, 1].map(|i| (frame[a][i] + frame[b][i]) / 2.0);
        let coco = COCO.iter().map(|(_, of)| at(*of));
        // Head, neck and hip; the toes stand in for both toes, the heels for themselves.
        let others = [
            at(0),
            mid(11, 12),
            mid(23, 24),
            at(31),
            at(32),
            at(31),
            at(32),
            at(29),
            at(30),
        ];
        coco.chain(others).collect()
    };
    let all: Vec<Vec<[f64; 2]>> = landmarks().iter().map(halpe).collect();
    let notes = lands(
        written(dir.path(), "halpe.json", &json!(all).to_string()),
        "halpe26",
        2.5,
    );
    assert!(notes.contains("of x and y"), "{notes}");
    let few: Vec<Vec<[f64; 2]>> = all.iter().map(|frame| frame[..18].to_vec()).collect();
    let path = written(dir.path(), "few.json", &json!(few).to_string());
    let refused = |options: &Options| {
        let refused = read(Format::AUTO, &files("clip/frames"), options);
        refused.expect_err("must be refused").to_string()
    };
    let message = refused(&options(path.clone()));
    assert!(
        message.contains("18 points: which are they?") && message.contains("--points"),
        "{message}"
    );
    let told = Options {
        points: Some(PointSet::Coco17),
        ..options(path)
    };
    let message = refused(&told);
    assert!(message.contains("18 points: coco17 has 17"), "{message}");
    // World landmarks alone.
    let around_hips = |frame: &Vec<[f64; 4]>| -> Vec<[f64; 3]> {
        let hips = [0, 1].map(|i| (frame[23][i] + frame[24][i]) / 2.0);
        frame
            .iter()
            .map(|p| [(p[0] - hips[0]) / 50.0, (p[1] - hips[1]) / 50.0, p[2] * 0.1])
            .collect()
    };
    let all: Vec<Vec<[f64; 3]>> = landmarks().iter().map(around_hips).collect();
    let message = refused(&options(written(
        dir.path(),
        "space.json",
        &json!(all).to_string(),
    )));
    assert!(
        message.contains("points in space, around the hips"),
        "{message}"
    );
}

/// A table whose rows are of the clip's `frames`, each numbered by `number`.
fn table(dir: &Path, frames: std::ops::Range<usize>, number: impl Fn(usize) -> usize) -> PathBuf {
    let mut text = String::new();
    let all = landmarks();
    for frame in frames {
        text += &number(frame).to_string();
        for [x, y, z, sure] in &all[frame] {
            text += &format!(",{},{},{z},{sure}", x / 64.0, y / 96.0);
        }
        text.push('\n');
    }
    written(dir, "landmarks.csv", &text)
}

#[test]
fn frames_counted_from_one_are_found_by_all_numbers() {
    let dir = tempfile::tempdir().expect("a folder");
    let notes = lands(
        table(dir.path(), 0..16, |frame| frame + 1),
        "are counted from 1",
        2.0,
    );
    assert!(notes.contains("the clip has 16 frames"), "{notes}");
    let notes = lands(table(dir.path(), 0..16, |frame| frame), "MediaPipe", 2.0);
    assert!(!notes.contains("counted"), "{notes}");
}

#[test]
fn masks_decide_where_the_numbers_do_not() {
    let dir = tempfile::tempdir().expect("a folder");
    for (frames, first) in [(0..12, 1), (1..13, 0)] {
        let path = table(dir.path(), frames.clone(), |frame| frame + first);
        let masked = Options {
            masks: Some(files("clip/masks")),
            ..options(path.clone())
        };
        let found = import(&masked);
        let notes = found.notes.join("\n");
        assert_eq!(indices(&found), frames.collect::<Vec<_>>(), "{notes}");
        assert!(
            notes.contains(&format!("1 to 12, are counted from {first}")),
            "{notes}"
        );
        let off = off(&found, 0);
        assert!(off < 2.0, "{off} px; {notes}");
        let notes = import(&options(path)).notes.join("\n");
        assert!(
            notes.contains("counted from 1, or from 0: only masks tell"),
            "{notes}"
        );
    }
}

#[test]
fn points_that_are_not_finite_are_unseen() {
    let dir = tempfile::tempdir().expect("a folder");
    let rows: Vec<Vec<[f64; 4]>> = landmarks();
    let mut text = json!(rows).to_string();
    // As Python writes it.
    let first = rows[0][0][0].to_string();
    assert!(text.contains(&first));
    text = text.replacen(&first, "NaN", 1);
    let notes = lands(
        written(dir.path(), "nan.json", &text),
        "not finite: 1 points",
        2.0,
    );
    assert!(notes.contains("in frames 0"), "{notes}");
}
