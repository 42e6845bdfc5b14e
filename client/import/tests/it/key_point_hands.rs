//! Hands of full-body sets of key points.

use crate::format;
use crate::key_points::{files, import, options, spoiled};
use serde_json::{Value, json};
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::fingers::with_fingers;
use yoto_import::{Imported, read};
use yoto_synthetic::SyntheticPerson;

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

/// The 21 points of a hand of an average adult whose four fingers bend by `bend` at each joint, as MediaPipe has them: shares of a square
/// picture, the wrist at `wrist`.
fn holistic_hand(side: usize, bend: f32, wrist: [f64; 2]) -> Value {
    let body = SyntheticPerson::cast(1, 7)[0].skeleton();
    let body = Skeleton::from_track(&body).expect("a skeleton");
    let skeleton = with_fingers(&body).expect("SMPL's joints");
    let first = 24 + 15 * side;
    let sign = if side == 0 { -1.0 } else { 1.0 };
    let mut pose = Pose::rest(skeleton.joints());
    for joint in first..first + 12 {
        pose.rotations[joint] = [0.0, 0.0, sign * bend];
    }
    let joints = skeleton.posed_joints(&pose);
    // Thumb, index, middle, ring and little finger, whose tips go on as the bone above, bent once more or not.
    let mut points = vec![joints[20 + side]];
    for finger in [4, 0, 1, 3, 2] {
        let at = first + 3 * finger;
        let [_, middle, last] = [0, 1, 2].map(|joint| joints[at + joint]);
        points.extend_from_slice(&joints[at..at + 3]);
        points.push(std::array::from_fn(|axis| 2.0 * last[axis] - middle[axis]));
    }
    let origin = points[0];
    let shares = points.into_iter().map(|[x, y, z]| {
        // From above, with the fingers down in the picture.
        let [x, y, z] = [x - origin[0], y - origin[1], z - origin[2]];
        json!({"x": wrist[0] + 5.0 * z * f64::from(sign), "y": wrist[1] + 5.0 * x.abs(), "z": -5.0 * y, "visibility": 0.0})
    });
    shares.collect()
}

#[test]
fn hands_of_the_holistic_model_bend_fingers() {
    let dir = tempfile::tempdir().expect("a folder");
    let text = std::fs::read(files("mediapipe/landmarks.json")).expect("a file");
    let with_hands = |name: &str, bend: f32, left_out: &str| {
        let mut frames: Value = serde_json::from_slice(&text).expect("JSON");
        for frame in frames.as_array_mut().expect("frames") {
            for (side, (hand, wrist)) in [("left", 15), ("right", 16)].into_iter().enumerate() {
                let at = ["x", "y"].map(|axis| frame["pose_landmarks"][wrist][axis].as_f64());
                let at = at.map(|it| it.expect("a number"));
                if hand != left_out {
                    frame[format!("{hand}_hand_landmarks")] = holistic_hand(side, bend, at);
                }
            }
        }
        let path = dir.path().join(name);
        std::fs::write(&path, frames.to_string()).expect("writes");
        path
    };
    let bends = |found: &Imported, side: usize| -> f64 {
        let frame = &found.track.frames[found.track.frames.len() / 2];
        let joints = (0..4).map(|finger| 24 + 15 * side + 3 * finger);
        let z = joints.map(|joint| frame.pose[3 * joint + 2].abs());
        z.sum::<f64>().to_degrees() / 4.0
    };
    let fist = import(&options(with_hands("fist.json", 1.0, "")));
    let flat = import(&options(with_hands("flat.json", 0.05, "")));
    assert_eq!(fist.track.joints(), 54);
    for side in 0..2 {
        let (closed, open) = (bends(&fist, side), bends(&flat, side));
        assert!(closed > 45.0 && open < 15.0, "{side}: {closed}°, {open}°");
    }
    // A hand that the file lacks is half open.
    let left = import(&options(with_hands("left.json", 1.0, "right")));
    let half = bends(&left, 1);
    assert!(
        bends(&left, 0) > 45.0 && (12.0..30.0).contains(&half),
        "{half}°"
    );
    let short = with_hands("short.json", 1.0, "");
    let mut frames: Value =
        serde_json::from_slice(&std::fs::read(&short).expect("a file")).expect("JSON");
    for frame in frames.as_array_mut().expect("frames") {
        frame["left_hand_landmarks"]
            .as_array_mut()
            .expect("points")
            .pop();
    }
    std::fs::write(&short, frames.to_string()).expect("writes");
    let error = read(format("key-points"), &files("clip/frames"), &options(short));
    let error = format!("{:?}", error.expect_err("a point is missing"));
    assert!(error.contains("20 landmarks instead of 21"), "{error}");
}
