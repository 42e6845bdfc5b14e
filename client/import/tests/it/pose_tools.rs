//! Files of pose tools, against the joints that the script that wrote them knows
//! (`tests/formats/pose_tools`), and files that break the tools' own conventions.

use serde::Deserialize;
use serde_json::json;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;
use yoto_import::{Format, Imported, Options, Pictures, TrackForm, pose_tools, read, write};
use yoto_proto::pose_track::PoseTrack;

/// What the script says.
#[derive(Deserialize)]
pub(crate) struct Truth {
    pub image_size: [u32; 2],
    pub rest_joints: Vec<[f64; 3]>,
    pub people: Vec<Body>,
    pub tools: HashMap<String, ToolTruth>,
}

/// A person in all 16 frames.
#[derive(Deserialize)]
pub(crate) struct Body {
    pub poses: Vec<Vec<f64>>,
    pub t: Vec<[f64; 3]>,
    pub joints: Vec<Vec<[f64; 3]>>,
    /// Counted from the first pixel's centre.
    pub pixels: Vec<Vec<[f64; 2]>>,
}

#[derive(Deserialize)]
pub(crate) struct ToolTruth {
    pub k: [[f64; 3]; 3],
    pub people: Vec<Seen>,
    /// By kind of camera's file, of a tool whose camera moves.
    #[serde(default)]
    pub camera_to_world: HashMap<String, Vec<ToWorld>>,
}

/// A point x in the camera's axes is at r x + t.
#[derive(Deserialize)]
pub(crate) struct ToWorld {
    pub r: [[f64; 3]; 3],
    pub t: [f64; 3],
}

#[derive(Deserialize)]
pub(crate) struct Seen {
    /// Of the person, counted from 1.
    pub person: usize,
    pub frames: Vec<usize>,
    /// Where the tool's camera makes them other than the truth.
    pub pixels: Option<Vec<Vec<[f64; 2]>>>,
}

pub(crate) fn files(name: &str) -> PathBuf {
    crate::captures("../pose_tools/captures").join(name)
}

pub(crate) fn truth() -> Truth {
    let text = std::fs::read(files("expected.json")).expect("the script's figures");
    serde_json::from_slice(&text).expect("JSON")
}

/// Each tool, its files, and the format that forces it.
pub(crate) const TOOLS: [(&str, &str, &str); 10] = [
    ("phalp", "phalp/outputs/results/demo_walk.pkl", "phalp"),
    ("wham", "wham/output/demo/walk", "wham"),
    ("gvhmr", "gvhmr/outputs/demo/walk/hmr4d_results.pt", "gvhmr"),
    ("tram", "tram/results/walk", "tram"),
    ("romp", "romp", "romp"),
    ("bev", "bev", "romp"),
    ("prompt_hmr", "prompt_hmr/results/walk", "prompthmr"),
    ("lhm", "lhm", "lhm"),
    ("ex_avatar", "ex_avatar", "exavatar"),
    ("easymocap", "easymocap", "easymocap"),
];

#[test]
fn every_tool_has_files_of_its_own() {
    for (format, name) in pose_tools() {
        let has_files = TOOLS.iter().any(|(.., from)| *from == format.name());
        assert!(has_files, "TOOLS lacks {name}");
    }
}

/// The script's rest joints as a file.
pub(crate) fn rest_joints(dir: &Path) -> PathBuf {
    let path = dir.join("rest.json");
    std::fs::write(&path, json!({"joints": truth().rest_joints}).to_string()).expect("writes");
    path
}

pub(crate) fn options(dir: &Path, poses: PathBuf) -> Options {
    Options {
        poses: Some(poses),
        rest_joints: Some(rest_joints(dir)),
        masks: Some(files("clip/masks")),
        fps: Some(25.0),
        ..Options::default()
    }
}

pub(crate) fn import(options: &Options) -> Imported {
    read(Format::AUTO, &files("clip/frames"), options).expect("imports")
}

/// The largest distance of a joint's pixel from where `wanted` has it, by frame.
pub(crate) fn off(track: &PoseTrack, wanted: impl Fn(usize) -> Vec<[f64; 2]>) -> f64 {
    let skeleton = Skeleton::from_track(&track.skeleton).expect("a skeleton");
    let mut worst: f64 = 0.0;
    for frame in &track.frames {
        let pose = Pose::from_frame(frame).expect("a pose");
        let camera = Camera::from_frame(frame, track.image_size).expect("a camera");
        let joints = skeleton.posed_joints(&pose);
        // The last joints are the hands, which SMPL-X has no rotations of, but places.
        for (joint, [u, v]) in joints.iter().zip(wanted(frame.index as usize)) {
            let seen = camera.project(*joint).expect("in front of the camera");
            worst = worst.max((seen[0] - 0.5 - u).hypot(seen[1] - 0.5 - v));
        }
    }
    worst
}

pub(crate) fn indices(track: &PoseTrack) -> Vec<usize> {
    track
        .frames
        .iter()
        .map(|frame| frame.index as usize)
        .collect()
}

#[test]
fn every_tool_s_joints_land_where_the_script_has_them() {
    let dir = tempfile::tempdir().expect("a folder");
    let truth = truth();
    for (name, path, format) in TOOLS {
        let tool = &truth.tools[name];
        let seen = &tool.people[0];
        let options = options(dir.path(), files(path));
        for format in [Format::AUTO, crate::format(format)] {
            let found = read(format, &files("clip/frames"), &options);
            let found = found.unwrap_or_else(|error| panic!("{name}: {error}"));
            let notes = found.notes.join("\n");
            assert_eq!(found.track.image_size, truth.image_size);
            assert_eq!(indices(&found.track), seen.frames, "{name}");
            let wanted = |frame: usize| match &seen.pixels {
                Some(pixels) => {
                    let at = seen.frames.iter().position(|it| *it == frame);
                    pixels[at.expect("seen")].clone()
                }
                None => truth.people[seen.person - 1].pixels[frame].clone(),
            };
            let off = off(&found.track, wanted);
            assert!(off < 0.5, "{name}: {off:.2} px; {notes}");
            let k = found.track.frames[0].k;
            assert!((k[0][0] / tool.k[0][0] - 1.0).abs() < 1e-3, "{name}: {k:?}");
            assert!(
                notes.contains("documents (") && !notes.contains("not as"),
                "{name}: {notes}"
            );
            assert_eq!(
                tool.people.len() > 1,
                notes.contains("--person"),
                "{name}: {notes}"
            );
        }
    }
}

#[test]
fn people_are_chosen_by_masks_or_by_name_and_their_colour_is_said() {
    let dir = tempfile::tempdir().expect("a folder");
    let truth = truth();
    for (tool, name) in [(0, "2"), (1, "1"), (6, "2")] {
        let (tool, path, _) = TOOLS[tool];
        let first = import(&options(dir.path(), files(path)));
        let notes = first.notes.join("\n");
        assert!(
            notes.contains("#800000") && notes.contains("(9 frames) (--person)"),
            "{notes}"
        );
        let second = Options {
            person: Some(name.into()),
            ..options(dir.path(), files(path))
        };
        let second = import(&second);
        let notes = second.notes.join("\n");
        assert!(notes.contains("#008000"), "{notes}");
        assert!(
            notes.contains("7 frames without a pose of the person (0–2, 12–15)"),
            "{notes}"
        );
        let seen = &truth.tools[tool].people[1];
        assert_eq!(indices(&second.track), seen.frames);
    }
    let some = Options {
        frames: Some((4, 12, 3)),
        ..options(dir.path(), files(TOOLS[1].1))
    };
    assert_eq!(indices(&import(&some).track), [4, 7, 10]);
    let own = Options {
        masks: None,
        ..options(dir.path(), files(TOOLS[0].1))
    };
    let found = import(&own);
    let notes = found.notes.join("\n");
    assert!(notes.contains("the tool's own masks"), "{notes}");
    let out = dir.path().join("out");
    write(&found, &out, TrackForm::Json, |_, _, _| {}).expect("writes");
    let mask = image::open(out.join("masks/000007.png"))
        .expect("a mask")
        .into_luma8();
    // The nearer of the two, who hides a part of the other: the palette's picture is the same.
    let palette = image::open(files("clip/masks/00007.png"))
        .expect("a mask")
        .into_rgb8();
    for (pixel, colour) in mask.pixels().zip(palette.pixels()) {
        assert_eq!(pixel.0[0] == 255, colour.0 == [128, 0, 0]);
    }
}

#[test]
fn a_focal_length_of_the_user_s_moves_the_body_away_and_not_across() {
    let dir = tempfile::tempdir().expect("a folder");
    let usual = import(&options(dir.path(), files(TOOLS[1].1)));
    let longer = Options {
        focal: Some(2.0 * usual.track.frames[0].k[0][0]),
        ..options(dir.path(), files(TOOLS[1].1))
    };
    let longer = import(&longer);
    assert!(longer.notes.join("\n").contains("2.000 times as long"));
    let pelvis = |track: &PoseTrack, at: usize| {
        let rest = track.skeleton.rest_joints[0];
        let frame = &track.frames[at];
        std::array::from_fn::<f64, 3, _>(|i| rest[i] + frame.translation[i])
    };
    for at in 0..usual.track.frames.len() {
        let (near, far) = (pelvis(&usual.track, at), pelvis(&longer.track, at));
        assert!((far[2] / near[2] - 2.0).abs() < 1e-9);
        assert!((far[0] - near[0]).abs() < 1e-9 && (far[1] - near[1]).abs() < 1e-9);
    }
}

/// A clip of 20 frames in which a bar moves, 15 a second.
fn film(name: &str) -> PathBuf {
    crate::captures("../../../worker/media/tests/clips").join(name)
}

#[test]
fn poses_of_a_copy_with_another_rate_go_to_the_nearest_frames() {
    let dir = tempfile::tempdir().expect("a folder");
    let poses = dir.path().join("hmr4d_results.pkl");
    let body = &truth().people[0];
    let row = |frame: usize| &body.poses[frame % 16];
    let incam = json!({
        "global_orient": (0..40).map(|frame| row(frame)[..3].to_vec()).collect::<Vec<_>>(),
        "body_pose": (0..40).map(|frame| row(frame)[3..66].to_vec()).collect::<Vec<_>>(),
        "transl": (0..40).map(|frame| body.t[frame % 16]).collect::<Vec<_>>(),
        "betas": [vec![0.0; 10]],
    });
    crate::pickled::write(&poses, &json!({ "smpl_params_incam": incam }));
    let options = Options {
        masks: None,
        ..options(dir.path(), poses)
    };
    let found = read(Format::AUTO, &film("baseline.mp4"), &options).expect("imports");
    let notes = found.notes.join("\n");
    assert!(
        notes.contains("copy of 30 frames per second (40 frames)"),
        "{notes}"
    );
    assert_eq!(indices(&found.track), (0..20).collect::<Vec<_>>());
    // The pose of frame 6 of the copy is that of frame 3 of the clip.
    let root = |at: usize| &found.track.frames[at].pose[3..6];
    assert_eq!(root(3), &body.poses[6][3..6]);
    let masked = Options {
        masks: Some(film("b_frames.mp4")),
        ..options
    };
    let text = read(Format::AUTO, &film("baseline.mp4"), &masked);
    let text = text
        .map(|found| found.notes)
        .expect_err("no person")
        .to_string();
    assert!(
        text.contains("do not agree with the masks in b_frames.mp4"),
        "{text}"
    );
    let smaller = Options {
        masks: Some(film("turned_right.mp4")),
        ..masked
    };
    let text = read(Format::AUTO, &film("baseline.mp4"), &smaller);
    let text = text
        .map(|found| found.notes)
        .expect_err("turned")
        .to_string();
    assert!(
        text.contains("turned_right.mp4: 38x50 pixels, the clip has 50x38"),
        "{text}"
    );
}

#[test]
fn a_video_is_a_clip_with_its_own_size_and_rate() {
    let dir = tempfile::tempdir().expect("a folder");
    let poses = dir.path().join("wham_output.pkl");
    let body = &truth().people[0];
    let people = json!({"0": {"pose": body.poses[..3], "trans": body.t[..3], "betas": [vec![0.0; 10]],
        "frame_ids": [0, 1, 3]}});
    crate::pickled::write(&poses, &people);
    let options = Options {
        masks: None,
        fps: None,
        ..options(dir.path(), poses)
    };
    let film = film("turned_right.mp4");
    let found = read(Format::AUTO, &film, &options).expect("imports");
    assert_eq!(found.track.image_size, [38, 50]);
    assert_eq!(indices(&found.track), [0, 1, 3]);
    assert!((found.track.fps - 15.0).abs() < 0.1, "{}", found.track.fps);
    let notes = found.notes.join("\n");
    assert!(
        notes.contains("WHAM: 1 person, 3 frames") && notes.contains("nothing proves"),
        "{notes}"
    );
    assert!(
        notes.contains("17 frames without a pose of the person (2, 4–19)"),
        "{notes}"
    );
    let Pictures::Video { video, masks } = &found.pictures else {
        panic!("a video");
    };
    assert_eq!((video, masks.len()), (&film, 3));
    let out = dir.path().join("out");
    write(&found, &out, TrackForm::Json, |_, _, _| {}).expect("writes");
    assert!(out.join("video.mp4").is_file() && !out.join("masks/000000.png").exists());
}
