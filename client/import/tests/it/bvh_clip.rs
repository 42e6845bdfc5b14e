//! Clips with their person's motion as BVH: joints land where the script has them, and what is wrong is
//! corrected and said, or refused.

use crate::bvh::{MIXAMO, UNTURNED, bvh};
use crate::format;
use crate::own_skeleton::smpl;
use crate::pose_tools::{files, indices, truth};
use std::path::Path;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::transform::{Mat3, matmul, matvec, rodrigues, transpose};
use yoto_import::{Format, Imported, Options, read};
use yoto_proto::pose_track::{Frame, NO_DISTORTION, PoseTrack};
use yoto_proto::smpl::JOINTS;

/// From the camera's axes to those with y up, in which the camera looks along −z.
const Y_UP: Mat3 = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]];

/// From axes with y up to those with z up.
const Z_UP: Mat3 = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]];
/// Most by which joints may be beside their pixels: the script's camera looks half a pixel beside the
/// picture's middle, which a file without a camera can't tell.
const HALF: f64 = 0.8;

/// The script's first person in `frames`, in the camera's axes.
fn track(frames: impl IntoIterator<Item = usize>) -> PoseTrack {
    let body = &truth().people[0];
    let frame = |at: usize| Frame {
        index: at as u32,
        pose: body.poses[at].clone(),
        translation: body.t[at],
        k: [[0.0; 3]; 3],
        e: [[0.0; 4]; 4],
    };
    PoseTrack {
        skeleton: smpl(),
        image_size: truth().image_size,
        fps: 25.0,
        distortion: NO_DISTORTION,
        frames: frames.into_iter().map(frame).collect(),
    }
}

fn options(dir: &Path, text: &str) -> Options {
    let path = dir.join("walk.bvh");
    std::fs::write(&path, text).expect("writes");
    Options {
        poses: Some(path),
        masks: Some(files("clip/masks")),
        fps: Some(25.0),
        keep_skeleton: true,
        ..Options::default()
    }
}

fn import(options: &Options) -> Imported {
    read(Format::AUTO, &files("clip/frames"), options).expect("imports")
}

fn refused(options: &Options) -> String {
    let done = read(Format::AUTO, &files("clip/frames"), options);
    done.map(|found| found.notes)
        .expect_err("refused")
        .to_string()
}

/// Joints land where the script has those of frame `of(index)`.
fn lands(found: &Imported, of: impl Fn(usize) -> usize) {
    let truth = truth();
    let notes = found.notes.join("\n");
    let skeleton = Skeleton::from_track(&found.track.skeleton).expect("a skeleton");
    assert!(!found.track.frames.is_empty());
    for frame in &found.track.frames {
        let pose = Pose::from_frame(frame).expect("a pose");
        let camera = Camera::from_frame(frame, found.track.image_size).expect("a camera");
        for (joint, name) in skeleton.posed_joints(&pose).iter().zip(&skeleton.names) {
            let index = MIXAMO.iter().position(|it| it == name);
            let index = index.or_else(|| JOINTS.iter().position(|(it, _)| it == name));
            let index = index.expect(name);
            let seen = camera.project(*joint).expect("in front of the camera");
            let [u, v] = truth.people[0].pixels[of(frame.index as usize)][index];
            let off = (seen[0] - 0.5 - u).hypot(seen[1] - 0.5 - v);
            assert!(
                off < HALF,
                "frame {} {name}: {off} px; {notes}",
                frame.index
            );
        }
    }
}

#[test]
fn the_file_s_own_joints_are_kept_or_smpl_s_are_found() {
    let dir = tempfile::tempdir().expect("a folder");
    let own = options(dir.path(), &bvh(&track(0..16), 0.01, &Y_UP, &UNTURNED));
    let found = import(&own);
    let notes = found.notes.join("\n");
    for note in [
        "recognised: BVH",
        "22 joints of the file's own; 2 others are merged",
        "lengths are in centimetres",
        "read with a camera at the origin that looks along −z, the focal length √(W²+H²)",
        "#800000",
    ] {
        assert!(notes.contains(note), "{note}: {notes}");
    }
    let names = &found.track.skeleton.names;
    assert!(
        names.iter().all(|name| MIXAMO.contains(&&**name)),
        "{names:?}"
    );
    assert!(
        !names.iter().any(|name| name.contains("Middle")),
        "{names:?}"
    );
    assert_eq!(indices(&found.track), (0..16).collect::<Vec<_>>());
    lands(&found, |index| index);
    let smpl = Options {
        keep_skeleton: false,
        ..own
    };
    let found = import(&smpl);
    assert_eq!(found.track.skeleton.names.len(), 24);
    assert!(found.track.skeleton.names.contains(&"l_hip".to_owned()));
    lands(&found, |index| index);
}

#[test]
fn units_directions_frames_and_rates_are_found() {
    let dir = tempfile::tempdir().expect("a folder");
    let along = matmul(
        &[[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]],
        &Y_UP,
    );
    let found = import(&options(
        dir.path(),
        &bvh(&track(0..16), 1.0, &along, &UNTURNED),
    ));
    let notes = found.notes.join("\n");
    assert!(notes.contains("lengths are in metres"), "{notes}");
    assert!(
        notes.contains("not with a camera at the origin that looks along −z")
            && notes.contains("looks along +z"),
        "{notes}"
    );
    lands(&found, |index| index);
    let inches = options(dir.path(), &bvh(&track(0..16), 0.1, &Y_UP, &UNTURNED));
    let text = refused(&inches);
    assert!(text.contains("no person in metres"), "{text}");

    // A clip of every fourth frame, in which a frame is a large step.
    let clip = dir.path().join("clip");
    for (folder, digits) in [("frames", 6), ("masks", 5)] {
        std::fs::create_dir_all(clip.join(folder)).expect("a folder");
        for at in 0..4 {
            let from = files(&format!("clip/{folder}/{:0digits$}.png", 4 * at));
            std::fs::copy(from, clip.join(format!("{folder}/{at:06}.png"))).expect("copies");
        }
    }
    let of = |frames: &[usize], fps: f64| {
        let mut track = track(frames.iter().copied());
        track.fps = fps;
        let options = Options {
            masks: Some(clip.join("masks")),
            fps: Some(25.0),
            ..options(dir.path(), &bvh(&track, 0.01, &Y_UP, &UNTURNED))
        };
        read(Format::AUTO, &clip.join("frames"), &options)
    };
    let early = of(&[4, 8, 12], 25.0).expect("imports");
    let notes = early.notes.join("\n");
    assert!(notes.contains("a frame later than its number"), "{notes}");
    assert_eq!(indices(&early.track), [1, 2, 3]);
    lands(&early, |index| 4 * index);
    let faster = of(&(0..16).collect::<Vec<_>>(), 100.0).expect("imports");
    let notes = faster.notes.join("\n");
    assert!(notes.contains("nearest in time"), "{notes}");
    lands(&faster, |index| 4 * index);
    let longer = of(&(0..16).collect::<Vec<_>>(), 25.0).expect_err("too long");
    assert!(longer.to_string().contains("is this the clip"), "{longer}");
}

/// A matrix of OpenCV's files.
fn matrix(name: &str, rows: usize, numbers: &[f64]) -> String {
    let data: Vec<String> = numbers.iter().map(|it| format!("{it:.9}")).collect();
    let columns = numbers.len() / rows;
    format!(
        "{name}: !!opencv-matrix\n  rows: {rows}\n  cols: {columns}\n  dt: d\n  data: [{}]\n",
        data.join(", ")
    )
}

#[test]
fn the_camera_is_opencv_s_beside_the_file() {
    let dir = tempfile::tempdir().expect("a folder");
    // World to camera, of a world with z up.
    let rotation = matmul(
        &rodrigues([0.0, 0.1, 0.0]),
        &[[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]],
    );
    let shift = [0.2, 1.1, 0.4];
    let back = transpose(&rotation);
    // The camera's axes to the world's, about the camera's position.
    let mut moved = track(0..16);
    for frame in &mut moved.frames {
        for (value, shift) in frame.translation.iter_mut().zip(shift) {
            *value -= shift;
        }
    }
    let text = bvh(&moved, 0.01, &back, &Z_UP);
    let k: Vec<f64> = serde_json::from_value::<Vec<Vec<f64>>>(k())
        .expect("rows")
        .concat();
    let head = "%YAML:1.0\n---\nnames:\n  - \"01\"\n";
    let write = |name: &str, text: &str| {
        std::fs::write(dir.path().join(name), format!("{head}{text}")).expect("writes");
    };
    write("intri.yml", &matrix("K_01", 3, &k));
    let extri = |rotation: &Mat3, shift: [f64; 3]| {
        matrix("Rot_01", 3, rotation.as_flattened()) + &matrix("T_01", 3, &shift)
    };
    write("extri.yml", &extri(&rotation, shift));
    let given = options(dir.path(), &text);
    let found = import(&given);
    let notes = found.notes.join("\n");
    assert!(
        notes.contains("z is up")
            && notes.contains("read with the camera of extri.yml, the file's"),
        "{notes}"
    );
    lands(&found, |index| index);
    // From the camera to the world, as some calibrations have it.
    write("extri.yml", &extri(&back, matvec(&back, shift).map(|v| -v)));
    let found = import(&given);
    let notes = found.notes.join("\n");
    assert!(
        notes.contains("read from the camera to the world"),
        "{notes}"
    );
    lands(&found, |index| index);
    // Somebody else's camera.
    write("extri.yml", &extri(&rotation, [1.5, 1.1, 0.4]));
    let text = refused(&given);
    assert!(
        text.contains("does not agree with the masks in any of") && text.contains("extri.yml"),
        "{text}"
    );
}

/// The clip's K.
fn k() -> serde_json::Value {
    let text = std::fs::read(files("expected.json")).expect("the script's figures");
    let json: serde_json::Value = serde_json::from_slice(&text).expect("JSON");
    json["k"].clone()
}

#[test]
fn what_is_not_there_is_said() {
    let dir = tempfile::tempdir().expect("a folder");
    let text = bvh(&track(0..12), 0.01, &Y_UP, &UNTURNED);
    let short = import(&options(dir.path(), &text));
    let notes = short.notes.join("\n");
    assert!(
        notes.contains("4 frames without a pose of the person (12–15)"),
        "{notes}"
    );
    let unmasked = Options {
        masks: None,
        ..options(dir.path(), &text)
    };
    let notes = import(&unmasked).notes.join("\n");
    assert!(notes.contains("nothing proves"), "{notes}");
    let tree = text.find("MOTION").expect("a motion");
    let cut = options(dir.path(), &text[..tree / 2]);
    let message = refused(&cut);
    assert!(message.contains("walk.bvh: line "), "{message}");
    let tall = Options {
        height: Some(1.8),
        ..options(dir.path(), &text)
    };
    let message = refused(&tall);
    assert!(
        message.contains("is read as bvh, which does not read --height"),
        "{message}"
    );
    let alone = read(format("bvh"), &files("clip/frames"), &Options::default());
    let message = alone.expect_err("no file").to_string();
    assert!(message.contains("--poses FILE.bvh"), "{message}");
}
