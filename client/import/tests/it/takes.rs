//! `--poses FILE` reads that file and the other files of its take, but no other take in the folder.

use crate::key_points::{files, import, off, options};
use crate::npz;
use std::fs;
use std::path::Path;
use yoto_import::{Format, Options, read};

/// OpenPose's files of a walk as the take `name`, with each person moved by `aside` pixels.
fn take(dir: &Path, name: &str, aside: f64) {
    for frame in 0..16 {
        let from = files(&format!("openpose/walk_{frame:012}_keypoints.json"));
        let mut value: serde_json::Value =
            serde_json::from_slice(&fs::read(from).expect("a file")).expect("JSON");
        for person in value["people"].as_array_mut().expect("people") {
            let points = person["pose_keypoints_2d"].as_array_mut().expect("points");
            for point in points.chunks_exact_mut(3) {
                let x = point[0].as_f64().expect("a number");
                point[0] = (x + aside).into();
            }
        }
        let path = dir.join(format!("{name}_{frame:012}_keypoints.json"));
        fs::write(path, value.to_string()).expect("writes");
    }
}

fn refused(options: &Options) -> String {
    let found = read(Format::AUTO, &files("clip/frames"), options);
    found.expect_err("two takes").to_string()
}

#[test]
fn two_takes_of_a_detector_are_asked_about_and_one_is_named_by_a_file() {
    let dir = tempfile::tempdir().expect("a folder");
    take(dir.path(), "A", 0.0);
    take(dir.path(), "B", 9.0);
    let message = refused(&options(dir.path().to_owned()));
    assert!(
        message.contains("two takes are here, such as A_000000000000_keypoints.json and B_"),
        "{message}"
    );
    let first = dir.path().join("A_000000000003_keypoints.json");
    let found = import(&options(first));
    assert_eq!(found.track.frames.len(), 16);
    let off = off(&found, 0);
    assert!(off < 1.5, "{off} px");
}

#[test]
fn a_file_of_all_frames_is_read_alone() {
    let dir = tempfile::tempdir().expect("a folder");
    let from = fs::read_dir(files("sam_3d_body")).expect("a folder");
    let from = from.map(|entry| entry.expect("a file").path()).min();
    let from = from.expect("a frame");
    let write = |name: &str, frames: usize| {
        npz::rewrite(&from, &dir.path().join(name), |name, array| {
            if name == "mask" {
                array.values.clear();
            }
            array.shape.insert(0, frames);
            array.values = array.values.repeat(frames);
        });
    };
    write("take_1.npz", 3);
    write("take_2.npz", 9);
    let message = refused(&options(dir.path().to_owned()));
    assert!(
        message.contains("such as take_1.npz and take_2.npz"),
        "{message}"
    );
    let found = import(&options(dir.path().join("take_1.npz")));
    assert_eq!(found.track.frames.len(), 3);
}
