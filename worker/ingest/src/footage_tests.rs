//! Captures as people record them: other joint names, poses beyond the video's end, a hand-held camera.

use super::*;
use serde_json::{Value, json};
use yoto_proto::smpl::JOINTS;

/// The capture with its pose track changed.
fn edited(edit: impl FnOnce(&mut Value)) -> Vec<(String, Vec<u8>)> {
    let mut files = capture();
    let track = file(&mut files, FILE);
    let mut json: Value = serde_json::from_slice(track).expect("JSON");
    edit(&mut json);
    *track = serde_json::to_vec(&json).expect("JSON");
    files
}

/// Gives the track SMPL's 24 joints in `order` with the names `name`; poses and rest joints identify the joint.
fn with_joints(track: &mut Value, order: &[usize], name: impl Fn(&str) -> String) {
    let position = |joint| order.iter().position(|it| *it == joint);
    let parent = |&joint: &usize| match JOINTS[joint].1 {
        Some(above) => position(above).expect("is in the order") as i64,
        None => -1,
    };
    let rest = |&joint: &usize| [0.02 * joint as f64 - 0.2, 0.01 * joint as f64, 0.0];
    let pose: Vec<f64> = order
        .iter()
        .flat_map(|&it| [0.01 * it as f64, 0.0, 0.0])
        .collect();
    track["skeleton"] = json!({
        "names": order.iter().map(|&it| name(JOINTS[it].0)).collect::<Vec<_>>(),
        "parents": order.iter().map(parent).collect::<Vec<_>>(),
        "rest_joints": order.iter().map(rest).collect::<Vec<_>>(),
    });
    for frame in track["frames"].as_array_mut().expect("frames") {
        frame["pose"] = json!(pose);
    }
}

#[test]
fn joints_of_smpls_tree_get_its_names_and_order() {
    let in_order: Vec<usize> = (0..24).collect();
    let smpl = edited(|track| with_joints(track, &in_order, str::to_owned));
    let smpl = prepared(&smpl).expect("prepared").0.track;
    let legs_last = [
        0, 3, 6, 9, 12, 15, 13, 16, 18, 20, 22, 14, 17, 19, 21, 23, 1, 4, 7, 10, 2, 5, 8, 11,
    ];
    let long = |name: &str| name.replace("l_", "left_").replace("r_", "right_");
    for order in [&in_order[..], &legs_last] {
        let other = edited(|track| with_joints(track, order, long));
        let (shard, done, ..) = prepared(&other).expect("prepared");
        assert_eq!(shard.track, smpl, "both people have one tree");
        let told = done.notes.iter().find(|note| note.contains("SMPL's names"));
        let told = told.expect("a note");
        assert!(told.contains("l_hip for 'left_hip'"), "{told}");
        assert_eq!(told.contains("SMPL's order"), order == legs_last, "{told}");
    }
    let backwards = |name: &str| name.chars().rev().collect();
    let strange = edited(|track| with_joints(track, &in_order, backwards));
    let (shard, done, ..) = prepared(&strange).expect("prepared");
    assert_eq!(shard.track.skeleton.names[1], "pih_l");
    assert!(!done.notes.iter().any(|note| note.contains("SMPL")));
}

/// The media tests' clip of 20 frames of 50x38 pixels, with `poses` poses and `masks` masks.
fn filmed(poses: u32, masks: u32) -> Vec<(String, Vec<u8>)> {
    let mut files = edited(|track| {
        let mut first = track["frames"][0].take();
        first["K"] = json!([[20.0, 0.0, 25.0], [0.0, 20.0, 19.0], [0.0, 0.0, 1.0]]);
        let frame = |index| {
            first["index"] = json!(index);
            first.clone()
        };
        track["frames"] = (0..poses).map(frame).collect();
        track["image_size"] = json!([50, 38]);
    });
    files.truncate(1);
    let here = std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo runs the tests");
    let clip = std::path::Path::new(&here).join("../media/tests/clips/b_frames.mp4");
    files.push(("video.mp4".into(), std::fs::read(clip).expect("the clip")));
    let cover = image::GrayImage::from_fn(50, 38, |x, y| {
        let covered = (21..29).contains(&x) && (15..23).contains(&y);
        image::Luma([if covered { 255 } else { 0 }])
    });
    let mut png = std::io::Cursor::new(Vec::new());
    cover
        .write_to(&mut png, image::ImageFormat::Png)
        .expect("encodes");
    files.extend((0..masks).map(|index| (mask_path(index), png.get_ref().clone())));
    files
}

#[test]
fn a_few_poses_beyond_the_videos_end_are_left_out() {
    let whole = prepared(&filmed(20, 20)).expect("prepared");
    let one_more = prepared(&filmed(21, 20)).expect("prepared");
    assert_eq!(one_more.0.track, whole.0.track);
    assert_eq!((one_more.0.frames(), one_more.3.frames), (20, 20));
    let told = "video.mp4 has 20 frames: the pose of frame 20 is left out".to_owned();
    assert!(one_more.1.notes.contains(&told), "{:?}", one_more.1.notes);
    assert!(!whole.1.notes.iter().any(|note| note.contains("left out")));

    match prepared(&filmed(40, 40)) {
        Err(ReadFailure::Rejected(found)) => {
            let said: Vec<String> = found.iter().map(describe).collect();
            let expected = "video.mp4 frame 20: the pose track has this frame, but the video has \
                            only 20, 0 to 19: 20 of 40 poses are beyond its end";
            assert_eq!(said, [expected]);
        }
        other => panic!("not rejected: {:?}", other.map(|it| it.1)),
    }
}

#[test]
fn a_camera_in_the_hand_has_its_own_extrinsics_in_each_frame() {
    // The camera moves around the person, 3 m away, so the person stays in the middle.
    let turned = |angle: f64| {
        let (sin, cos) = angle.sin_cos();
        [
            [cos, 0.0, sin, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [-sin, 0.0, cos, 3.0],
            [0.0, 0.0, 0.0, 1.0],
        ]
    };
    let cameras = [0.0, 0.3, 0.6].map(turned);
    let files = edited(|track| {
        for (at, camera) in cameras.iter().enumerate() {
            track["frames"][at]["E"] = json!(camera);
            track["frames"][at]["K"][0][0] = json!(20.0 + at as f64);
        }
    });
    let track = prepared(&files).expect("prepared").0.track;
    for (at, frame) in track.frames.iter().enumerate() {
        assert_eq!(frame.e, cameras[at], "frame {}", frame.index);
        assert_eq!(frame.k[0][0], 20.0 + at as f64, "frame {}", frame.index);
    }
}
