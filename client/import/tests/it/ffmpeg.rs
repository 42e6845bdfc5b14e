//! Videos that are not decoded in-process, by a program that the user names.

use crate::pose_tools::{indices, options, truth};
use serde_json::json;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use yoto_import::{Format, Options, read};

/// Stands in for ffmpeg: four grey frames of 8×4, 20 a second.
const PROGRAM: &str = "#!/bin/sh
case \"$*\" in
*showinfo*) for t in 0 0.05 0.1 0.15; do echo \"pts_time:$t \" >&2; done ;;
*) for f in 1 2 3 4; do printf 'P6\\n8 4\\n255\\n%096d' 0; done ;;
esac
";

fn program(dir: &Path) -> PathBuf {
    let path = dir.join("my-ffmpeg");
    std::fs::write(&path, PROGRAM).expect("writes");
    let mode = std::fs::Permissions::from_mode(0o755);
    std::fs::set_permissions(&path, mode).expect("is runnable");
    path
}

#[test]
fn clips_and_masks_go_to_the_named_program() {
    let dir = tempfile::tempdir().expect("a folder");
    let poses = dir.path().join("wham_output.pkl");
    let body = &truth().people[0];
    let people = json!({"0": {"pose": body.poses[..3], "trans": body.t[..3],
        "betas": [vec![0.0; 10]], "frame_ids": [0, 1, 3]}});
    crate::pickled::write(&poses, &people);
    let video = crate::captures("../../../worker/media/tests/clips/hevc.mp4");
    let named = Options {
        masks: None,
        fps: None,
        ffmpeg: Some(program(dir.path())),
        ..options(dir.path(), poses)
    };
    let found = read(Format::AUTO, &video, &named).expect("imports");
    assert_eq!(found.track.image_size, [8, 4]);
    assert_eq!(indices(&found.track), [0, 1, 3]);
    assert!((found.track.fps - 20.0).abs() < 1e-6);
    let masked = Options {
        masks: Some(video.clone()),
        ..named.clone()
    };
    let text = read(Format::AUTO, &video, &masked);
    let text = text.map(|_| ()).expect_err("masks of nobody").to_string();
    assert!(!text.contains("ffmpeg"), "the masks were decoded: {text}");
    let none = Options {
        ffmpeg: Some(dir.path().join("nowhere")),
        ..named
    };
    let text = read(Format::AUTO, &video, &none);
    let text = text.map(|_| ()).expect_err("no program").to_string();
    assert!(text.contains("YOTO_FFMPEG"), "{text}");
}
