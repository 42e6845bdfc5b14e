//! The child's work on small captures, whole and broken, in this process.

use super::*;
use yoto_capture::Shard;
use yoto_capture::check::CheckReport;
use yoto_media::Limits;
use yoto_proto::pose_track::{self, FILE, Frame, PoseTrack, describe};

const SIDE: u32 = 16;

fn image_path(index: u32) -> String {
    format!("frames/{index:06}.png")
}

fn mask_path(index: u32) -> String {
    format!("masks/{index:06}.png")
}

/// Files of a capture of frames 7, 8 and 9: a square of coverage on black.
fn capture() -> Vec<(String, Vec<u8>)> {
    let frame = |index: u32| Frame {
        index,
        pose: vec![0.0; 6],
        translation: [0.0; 3],
        k: [[20.0, 0.0, 8.0], [0.0, 20.0, 8.0], [0.0, 0.0, 1.0]],
        e: [
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 3.0],
            [0.0, 0.0, 0.0, 1.0],
        ],
    };
    let track = PoseTrack {
        skeleton: pose_track::Skeleton {
            names: vec!["root".into(), "tip".into()],
            parents: vec![-1, 0],
            rest_joints: vec![[0.0; 3], [0.0, 0.5, 0.0]],
        },
        image_size: [SIDE, SIDE],
        fps: 15.0,
        distortion: [0.0; 5],
        frames: [7, 8, 9].map(frame).to_vec(),
    };
    let mut files = vec![(
        FILE.to_owned(),
        serde_json::to_vec(&track).expect("serialises"),
    )];
    for index in [7, 8, 9] {
        files.push((image_path(index), square([200, index as u8, 50], SIDE)));
        files.push((mask_path(index), mask(SIDE, 255)));
    }
    files
}

fn inside(i: u32, side: u32) -> bool {
    (side / 4..side * 3 / 4).contains(&i)
}

/// A PNG with `colour` in its middle.
fn square(colour: [u8; 3], side: u32) -> Vec<u8> {
    let rgb: Vec<u8> = (0..side * side)
        .flat_map(|i| {
            if inside(i / side, side) && inside(i % side, side) {
                colour
            } else {
                [0; 3]
            }
        })
        .collect();
    let picture = image::RgbImage::from_raw(side, side, rgb).expect("three bytes per pixel");
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture
        .write_to(&mut bytes, image::ImageFormat::Png)
        .expect("encodes");
    bytes.into_inner()
}

/// An 8-bit gray PNG with `coverage` in its middle.
fn mask(side: u32, coverage: u8) -> Vec<u8> {
    let pixel = |x, y| {
        image::Luma([if inside(x, side) && inside(y, side) {
            coverage
        } else {
            0
        }])
    };
    let mut bytes = std::io::Cursor::new(Vec::new());
    let gray = image::GrayImage::from_fn(side, side, pixel);
    gray.write_to(&mut bytes, image::ImageFormat::Png)
        .expect("encodes");
    bytes.into_inner()
}

/// Prepares a capture of `files`: the shard, or the faults.
#[allow(clippy::type_complexity)]
fn prepared(
    files: &[(String, Vec<u8>)],
) -> Result<(Shard, Prepared, Vec<Progress>, CheckReport), ReadFailure> {
    let dir = tempfile::tempdir().expect("a folder");
    let mut order = Order::new(dir.path(), &Limits::default());
    for (number, (path, bytes)) in files.iter().enumerate() {
        let disk = dir.path().join(number.to_string());
        std::fs::write(&disk, bytes).expect("writes");
        order.files.insert(path.clone(), disk);
    }
    let mut reports = Vec::new();
    let done = prepare(&order, &Ffmpeg::none(), &mut |progress| {
        reports.push(progress)
    })?;
    let bytes = std::fs::read(order.shard()).expect("is written");
    let shard = Shard::from_bytes(bytes).expect("reads");
    let report = std::fs::read(order.check()).expect("is written");
    let report = serde_json::from_slice(&report).expect("reads");
    Ok((shard, done, reports, report))
}

/// The violations of the broken capture, as lines.
fn rejected(break_it: impl FnOnce(&mut Vec<(String, Vec<u8>)>)) -> Vec<String> {
    let mut files = capture();
    break_it(&mut files);
    match prepared(&files) {
        Err(ReadFailure::Rejected(found)) => found.iter().map(describe).collect(),
        Err(other) => panic!("not rejected: {other:?}"),
        Ok(_) => panic!("not rejected"),
    }
}

fn file<'a>(files: &'a mut [(String, Vec<u8>)], path: &str) -> &'a mut Vec<u8> {
    let found = files.iter_mut().find(|(name, _)| name == path);
    &mut found.expect("the capture has it").1
}

#[test]
fn a_good_capture_becomes_a_shard_with_its_frames() {
    let (shard, done, reports, report) = prepared(&capture()).expect("prepared");
    assert_eq!((shard.frames(), shard.track.image_size), (3, [SIDE, SIDE]));
    let image = shard.image(1);
    let middle = (SIDE / 2 * SIDE + SIDE / 2) as usize;
    assert_eq!(image.mask[middle], 255);
    assert_eq!(image.rgb[3 * middle..3 * middle + 3], [200, 8, 50]);
    let last = reports.last().expect("it told");
    assert_eq!(
        (last.file.as_str(), last.frame, last.done, last.total),
        ("frames/000009.png", Some(9), 2, 3)
    );
    assert!(
        done.notes
            .iter()
            .any(|note| note.contains("bytes per frame")),
        "{:?}",
        done.notes
    );
    assert_eq!((report.frames, report.looked_at), (3, 3));
    let views = |line: &String| line.starts_with("view coverage: 1 of 12");
    assert!(done.warnings.iter().any(views), "{:?}", done.warnings);
}

#[test]
fn poses_that_miss_every_mask_are_refused_with_the_reason() {
    let found = rejected(|files| {
        let track = file(files, FILE);
        let mut json: serde_json::Value = serde_json::from_slice(track).expect("JSON");
        for frame in json["frames"].as_array_mut().expect("frames") {
            frame["E"][0][3] = 900.0.into();
        }
        *track = serde_json::to_vec(&json).expect("JSON");
    });
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(
        found[0].starts_with("poses.json: joints in the mask: 0.0 %"),
        "{found:?}"
    );
}

#[test]
fn a_plan_corrects_numbers_shifts_masks_and_turns_them_round() {
    let good = prepared(&capture()).expect("prepared").0;
    let mut files = capture();
    let track = file(&mut files, FILE);
    let mut json: serde_json::Value = serde_json::from_slice(track).expect("JSON");
    for frame in json["frames"].as_array_mut().expect("frames") {
        frame["E"][2][3] = 3000.0.into();
    }
    *track = serde_json::to_vec(&json).expect("JSON");
    // Each frame's mask is one frame late, and inverted.
    *file(&mut files, &mask_path(7)) = b"belongs to no frame".to_vec();
    for index in [8, 9] {
        let inverted = image::GrayImage::from_fn(SIDE, SIDE, |x, y| {
            let covered = inside(x, SIDE) && inside(y, SIDE);
            image::Luma([if covered { 0 } else { 255 }])
        });
        let mut bytes = std::io::Cursor::new(Vec::new());
        inverted
            .write_to(&mut bytes, image::ImageFormat::Png)
            .expect("encodes");
        *file(&mut files, &mask_path(index)) = bytes.into_inner();
    }
    let plan = r#"{"mask_kind": "inverted",
        "correction": {"units": {"camera": "mm"}, "mask_shift": 1}}"#;
    files.push(("media.json".to_owned(), plan.into()));
    let (shard, done, ..) = prepared(&files).expect("prepared");
    let indices: Vec<u32> = shard.track.frames.iter().map(|it| it.index).collect();
    assert_eq!(indices, [7, 8]);
    assert_eq!(shard.track.frames[..], good.track.frames[..2]);
    for at in 0..2 {
        assert_eq!(shard.image(at), good.image(at));
    }
    let note = "numbers read with --units camera=mm --mask-shift 1";
    assert!(done.notes.iter().any(|it| it == note), "{:?}", done.notes);
}

#[test]
fn a_lens_is_undone_in_picture_and_mask() {
    let mut files = capture();
    let track = file(&mut files, FILE);
    let mut json: serde_json::Value = serde_json::from_slice(track).expect("JSON");
    json["distortion"] = serde_json::json!([-0.9, 0.0, 0.0, 0.0, 0.0]);
    *track = serde_json::to_vec(&json).expect("JSON");
    let (shard, done, ..) = prepared(&files).expect("prepared");
    let plain = prepared(&capture()).expect("prepared").0;
    let sum = |bytes: &[u8]| bytes.iter().map(|&it| u64::from(it)).sum::<u64>();
    for at in 0..3 {
        let (undone, plain) = (shard.image(at), plain.image(at));
        assert!(
            sum(&undone.mask) > sum(&plain.mask) && sum(&undone.rgb) > sum(&plain.rgb),
            "a barrel lens shows things smaller than they are"
        );
    }
    assert_eq!(shard.track, plain.track, "training has straight rays");
    let told = |note: &String| note.starts_with("lens distortion corrected");
    assert!(done.notes.iter().any(told), "{:?}", done.notes);
}

#[test]
fn a_corrupt_mask_is_named_by_file_and_frame() {
    let found = rejected(|files| file(files, "masks/000008.png").truncate(40));
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(
        found[0].starts_with("masks/000008.png frame 8: "),
        "{found:?}"
    );
}

#[test]
fn every_broken_frame_is_named_not_just_the_first() {
    let found = rejected(|files| {
        *file(files, "frames/000007.png") = b"no picture".to_vec();
        *file(files, "masks/000009.png") = mask(SIDE / 2, 255);
    });
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(
        found[0].starts_with("frames/000007.png frame 7: "),
        "{found:?}"
    );
    assert!(
        found[1].starts_with("masks/000009.png frame 9: "),
        "{found:?}"
    );
}

#[test]
fn a_corrupt_pose_is_named_by_frame_and_field() {
    let found = rejected(|files| {
        let track = file(files, FILE);
        let mut json: serde_json::Value = serde_json::from_slice(track).expect("JSON");
        json["frames"][1]["translation"][2] = 1e30.into();
        *track = serde_json::to_vec(&json).expect("JSON");
    });
    assert!(
        found[0].starts_with("poses.json frame 8: translation[2]: "),
        "{found:?}"
    );
}

#[test]
fn missing_files_are_named() {
    let found = rejected(|files| {
        files.retain(|(path, _)| path != "masks/000009.png" && path != "frames/000007.png")
    });
    assert!(
        found[0].starts_with("frames/000007.png frame 7: "),
        "{found:?}"
    );
    assert!(
        found[1].starts_with("masks/000009.png frame 9: "),
        "{found:?}"
    );
    let found = rejected(|files| files.retain(|(path, _)| path != FILE));
    assert!(found[0].starts_with("poses.json: "), "{found:?}");
}

#[test]
fn a_capture_of_nobody_is_refused() {
    let found = rejected(|files| {
        for path in [7, 8, 9].map(mask_path) {
            *file(files, &path) = mask(SIDE, 0);
        }
    });
    assert!(found[0].starts_with("masks: no mask covers"), "{found:?}");
}

#[path = "footage_tests.rs"]
mod footage;

/// The capture before a wall, and masks that take some of it in.
fn before_a_wall() -> Vec<(String, Vec<u8>)> {
    let side = 64;
    let mut files = capture();
    for (path, bytes) in &mut files {
        let within = |i: u32, low: u32| (low..side - low).contains(&i);
        if path.starts_with("frames/") {
            let pixel = |x, y| match within(x, 16) && within(y, 16) {
                true => image::Rgb([30u8, 60, 90]),
                false => image::Rgb([200, 190, 180]),
            };
            *bytes = png(&image::RgbImage::from_fn(side, side, pixel));
        } else if path.starts_with("masks/") {
            let covered = |x, y| u8::from(within(x, 15) && within(y, 15));
            let pixel = |x, y| image::Luma([255 * covered(x, y)]);
            *bytes = png(&image::GrayImage::from_fn(side, side, pixel));
        }
    }
    let mut track: PoseTrack = serde_json::from_slice(&files[0].1).expect("is one");
    track.image_size = [side, side];
    for frame in &mut track.frames {
        frame.k = [[80.0, 0.0, 32.0], [0.0, 80.0, 32.0], [0.0, 0.0, 1.0]];
    }
    files[0].1 = serde_json::to_vec(&track).expect("serialises");
    files
}

fn png<P: image::PixelWithColorType<Subpixel = u8>>(
    picture: &image::ImageBuffer<P, Vec<u8>>,
) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture
        .write_to(&mut bytes, image::ImageFormat::Png)
        .expect("encodes");
    bytes.into_inner()
}

/// The brightest colour of the first frame, and whether the notes speak of edges.
fn brightest(files: &[(String, Vec<u8>)]) -> (u8, bool) {
    let (shard, done, ..) = prepared(files).expect("a valid capture");
    let image = shard.image(0);
    let notes = done.notes.iter().any(|it| it.starts_with("edges: solved"));
    (image.rgb.iter().copied().max().unwrap_or_default(), notes)
}

#[test]
fn a_wall_in_the_mask_is_solved_away_unless_edges_are_given() {
    let mut files = before_a_wall();
    let (bright, said) = brightest(&files);
    assert!(bright < 110 && said, "{bright}");
    files.push(("media.json".into(), br#"{"edges": "given"}"#.to_vec()));
    assert_eq!(brightest(&files), (200, false));
    assert!(!brightest(&capture()).1, "a person over black has no wall");
}
