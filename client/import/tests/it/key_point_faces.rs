//! Faces of MediaPipe's holistic model beside its 33 points of a body.

use crate::format;
use crate::key_points::{files, import, options};
use serde_json::{Value, json};
use yoto_import::read;

/// The landmarks of a face as shares of a picture of 64 by 96 pixels, 41 pixels wide between the eyes' outer corners, with an open mouth and open
/// eyes as told, from 0 to 1. Only those landmarks that are read are where they belong.
fn face(nose: [f64; 2], mouth: f64, eyes: f64) -> Vec<Value> {
    let mut points = vec![[0.0, 0.0]; 468];
    for (side, [inner, outer, upper, lower]) in
        [(1.0, [362, 263, 386, 374]), (-1.0, [133, 33, 159, 145])]
    {
        points[inner] = [0.2 * side, -0.4];
        points[outer] = [0.5 * side, -0.4];
        points[upper] = [0.35 * side, -0.4 - 0.05 * eyes];
        points[lower] = [0.35 * side, -0.4 + 0.05 * eyes];
    }
    points[13] = [0.0, 0.3];
    points[14] = [0.0, 0.31 + 0.3 * mouth];
    let share =
        |[x, y]: [f64; 2]| json!({"x": nose[0] + 0.65 * x, "y": nose[1] + 0.43 * y, "z": 0.0});
    points.into_iter().map(share).collect()
}

#[test]
fn faces_of_the_holistic_model_open_the_mouth_and_close_the_eyes() {
    let dir = tempfile::tempdir().expect("a folder");
    let text = std::fs::read(files("mediapipe/landmarks.json")).expect("a file");
    let written = |name: &str, change: &dyn Fn(usize, &mut Value)| {
        let mut frames: Value = serde_json::from_slice(&text).expect("JSON");
        let frames_of = frames.as_array_mut().expect("frames");
        for (at, frame) in frames_of.iter_mut().enumerate() {
            change(at, frame);
        }
        let path = dir.path().join(name);
        std::fs::write(&path, frames.to_string()).expect("writes");
        path
    };
    let nose = |frame: &Value| {
        ["x", "y"].map(|axis| frame["pose_landmarks"][0][axis].as_f64().expect("a number"))
    };
    let path = written("face.json", &|at, frame| {
        let eyes = if (5..9).contains(&at) { 0.0 } else { 1.0 };
        let mouth = if at / 4 % 2 == 0 { 1.0 } else { 0.0 };
        frame["face_landmarks"] = json!(face(nose(frame), mouth, eyes));
    });
    let found = import(&options(path));
    assert_eq!(found.track.joints(), 59);
    let greatest = |joint: usize| {
        let angles = found.track.frames.iter().map(|it| it.pose[3 * joint]);
        angles.fold(0.0, f64::max).to_degrees()
    };
    assert!((8.0..25.0).contains(&greatest(54)), "{}", greatest(54));
    assert!(greatest(57) > 10.0 && greatest(58) > 10.0);
    // An error names a missing landmark. A frame may lack a face.
    let path = written("short.json", &|at, frame| {
        let mut points = face(nose(frame), 0.5, 1.0);
        points.pop();
        frame["face_landmarks"] = if at == 0 { Value::Null } else { json!(points) };
    });
    let error = read(format("key-points"), &files("clip/frames"), &options(path));
    let error = format!("{:?}", error.expect_err("a point is missing"));
    assert!(error.contains("467 landmarks instead of 468"), "{error}");
}
