//! What an import writes: a capture folder of our own.

use crate::pose_tools::{options, truth};
#[cfg(feature = "hdf5")]
use crate::projected::assert_lands;
use crate::{captures, format};
use serde_json::json;
use yoto_import::capture_dir::{CaptureDir, DecodedCapture};
use yoto_import::{Format, Options, TrackForm, VIDEO, read, write};
use yoto_proto::pose_track::{BINARY_FILE, FILE, PoseTrack};

fn smpl() -> Options {
    Options {
        body_model: Some(captures("smpl/model.npz")),
        ..Options::default()
    }
}

/// Equal up to the last digit of numbers that went through text.
fn same_track(found: &PoseTrack, wanted: &PoseTrack) {
    let numbers = |track: &PoseTrack| {
        let rest = track.skeleton.rest_joints.as_flattened().iter();
        let frames = track.frames.iter().flat_map(|frame| {
            let matrices = frame.k.as_flattened().iter().chain(frame.e.as_flattened());
            frame.pose.iter().chain(&frame.translation).chain(matrices)
        });
        rest.chain(frames).copied().collect::<Vec<f64>>()
    };
    let (a, b) = (numbers(found), numbers(wanted));
    assert_eq!(a.len(), b.len());
    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-12));
    assert_eq!(found.skeleton.names, wanted.skeleton.names);
    assert_eq!(found.skeleton.parents, wanted.skeleton.parents);
    assert_eq!(found.distortion, wanted.distortion);
    assert_eq!(
        (found.image_size, found.fps),
        (wanted.image_size, wanted.fps)
    );
}

#[test]
fn a_capture_folder_comes_out_and_goes_in_again() {
    let out = tempfile::tempdir().expect("a folder");
    let dir = out.path().join("capture");
    let found = read(format("zju"), &captures("CoreView_377"), &smpl()).expect("reads");
    let mut heard = Vec::new();
    let bytes = write(&found, &dir, TrackForm::Json, |done, of, _| {
        heard.push((done, of))
    });
    assert_eq!(heard, [(0, 3), (1, 3), (2, 3), (3, 3)]);
    let capture = CaptureDir::open(&dir).expect("a capture");
    assert_eq!(capture.bytes, bytes.expect("writes"));
    same_track(
        &capture.planned.as_ref().expect("a folder has one").track,
        &found.track,
    );

    // The union of both label images, at full coverage; black where nobody is.
    let mask = image::open(dir.join("masks/000000.png"))
        .expect("a mask")
        .into_luma8();
    let label = |folder: &str| {
        let path = captures("CoreView_377")
            .join(folder)
            .join("Camera_B1/000000.png");
        image::open(path).expect("a label image").into_luma8()
    };
    let (one, two) = (label("mask"), label("mask_cihp"));
    let frame = image::open(dir.join("frames/000000.png"))
        .expect("a frame")
        .into_rgb8();
    let photo = captures("CoreView_377/Camera_B1/000000.jpg");
    let photo = image::open(photo).expect("a photo").into_rgb8();
    for (x, y, level) in mask.enumerate_pixels() {
        let inside = one.get_pixel(x, y)[0] != 0 || two.get_pixel(x, y)[0] != 0;
        assert_eq!(level[0], if inside { 255 } else { 0 });
        let colour = if inside {
            photo.get_pixel(x, y).0
        } else {
            [0; 3]
        };
        assert_eq!(frame.get_pixel(x, y).0, colour, "{x}, {y}");
    }
    assert!(one.iter().any(|level| *level != 0) && two.iter().any(|level| *level != 0));

    let again = out.path().join("again");
    let folder = read(Format::FOLDER, &dir, &Options::default()).expect("reads");
    write(&folder, &again, TrackForm::Binary, |_, _, _| {}).expect("writes");
    assert!(again.join(BINARY_FILE).is_file() && !again.join(FILE).exists());
    let copied = CaptureDir::open(&again).expect("a capture");
    assert_eq!(
        copied.planned, capture.planned,
        "binary numbers come back as they were"
    );
    let pixels = |dir: &std::path::Path| {
        image::open(dir.join("frames/000002.png"))
            .expect("a frame")
            .into_rgb8()
    };
    assert_eq!(pixels(&dir), pixels(&again));

    let error = write(&found, &dir, TrackForm::Json, |_, _, _| {}).expect_err("it is there");
    assert!(
        error.to_string().contains("already holds a capture"),
        "{error}"
    );
}

#[cfg(feature = "hdf5")]
#[test]
fn a_video_is_taken_over_with_its_masks() {
    let out = tempfile::tempdir().expect("a folder");
    let name = "people_snapshot/x-2-film";
    let some = Options {
        frames: Some((1, 4, 2)),
        ..smpl()
    };
    let found = read(format("people-snapshot"), &captures(name), &some).expect("reads");
    write(&found, out.path(), TrackForm::Json, |_, _, _| {}).expect("writes");
    let same = |a: std::path::PathBuf, b: std::path::PathBuf| {
        std::fs::read(a).expect("a file") == std::fs::read(b).expect("a file")
    };
    assert!(same(
        out.path().join(VIDEO),
        captures(name).join("x-2-film.mp4")
    ));
    assert!(!out.path().join("frames").exists());
    let text = std::fs::read(out.path().join(FILE)).expect("a track");
    let track = PoseTrack::from_json(&text).expect("a good track");
    assert_lands(&track, name, &[1, 3], 1e-3);
    let mask = image::open(out.path().join("masks/000003.png"))
        .expect("a mask")
        .into_luma8();
    let covered = mask.iter().filter(|level| **level == 255).count();
    assert!(covered > 50 && covered < mask.len() / 2, "{covered}");
    assert!(mask.iter().all(|level| matches!(level, 0 | 255)));
}

#[test]
fn a_capture_with_a_video_is_decoded_as_a_check_decodes_it() {
    let out = tempfile::tempdir().expect("a folder");
    let (film, copy) = (out.path().join("film"), out.path().join("copy"));
    let poses = out.path().join("wham_output.pkl");
    let body = &truth().people[0];
    let people = json!({"0": {"pose": body.poses[..4], "trans": body.t[..4],
        "betas": [vec![0.0; 10]], "frame_ids": [0, 1, 2, 3]}});
    crate::pickled::write(&poses, &people);
    let clip = captures("../../../worker/media/tests/clips/baseline.mp4");
    let of_tool = Options {
        masks: None,
        ..options(out.path(), poses)
    };
    let found = read(format("wham"), &clip, &of_tool).expect("reads");
    write(&found, &film, TrackForm::Json, |_, _, _| {}).expect("writes");
    let [width, height] = found.track.image_size;
    for frame in 0..4 {
        let mask = image::GrayImage::from_fn(width, height, |x, _| image::Luma([(5 * x) as u8]));
        mask.save(film.join(format!("masks/{frame:06}.png")))
            .expect("writes");
    }
    let some = Options {
        frames: Some((1, 4, 2)),
        ..Options::default()
    };
    for format in [Format::AUTO, Format::FOLDER] {
        let again = read(format, &film, &some).expect("reads");
        let indices: Vec<u32> = again.track.frames.iter().map(|it| it.index).collect();
        assert_eq!(indices, [1, 3]);
    }
    let again = read(Format::FOLDER, &film, &some).expect("reads");
    write(&again, &copy, TrackForm::Json, |_, _, _| {}).expect("writes");
    assert!(!copy.join(VIDEO).exists());
    let open = |path: &std::path::Path| {
        let options = yoto_import::capture_dir::CaptureOptions::default();
        DecodedCapture::open(path, &options, None).expect("a capture")
    };
    let (decoded, copied) = (open(&film), open(&copy));
    let mut wanted = Vec::new();
    let keep = |_, frame| wanted.push(frame);
    decoded.capture.frames(&[1, 3], keep).expect("decodes");
    let mut frames = Vec::new();
    let keep = |_, frame| frames.push(frame);
    copied.capture.frames(&[0, 1], keep).expect("decodes");
    assert_eq!(frames, wanted, "the same pixels, in other files");
    let best = Options {
        best: std::num::NonZeroUsize::new(1),
        ..Options::default()
    };
    let mut one = read(Format::FOLDER, &film, &best).expect("reads");
    let count = best.best.expect("one");
    yoto_import::best::choose(&mut one, count, None, |_, _| {}).expect("chooses");
    let dir = out.path().join("one");
    write(&one, &dir, TrackForm::Json, |_, _, _| {}).expect("writes");
    let files = std::fs::read_dir(dir.join("frames")).expect("a folder");
    assert_eq!((one.track.frames.len(), files.count()), (1, 1));
}
