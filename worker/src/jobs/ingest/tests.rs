//! Small captures, whole and broken, through the whole job.

use super::*;
use crate::{jobs::test_context::context, media::picture};
use yoto_avatar::capture::Shard;
use yoto_proto::{
    pose_track::{self, Frame, describe},
    v1::InputFile,
};

const SIDE: u32 = 16;

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
    picture::png(side, side, &rgb).expect("encodes")
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

/// Uploads `files` and ingests them.
async fn ingest(files: Vec<(String, Vec<u8>)>) -> (JobContext, Result<IngestResult, JobFailure>) {
    let context = context();
    let mut inputs = Inputs::default();
    for (path, bytes) in files {
        let object = context
            .objects
            .put(&keys::upload("c", &path), bytes.into())
            .await
            .expect("stored");
        inputs.files.push(InputFile {
            path,
            object: Some(object),
        });
    }
    let spec = IngestSpec {
        capture: "captures/c".into(),
    };
    let job = move || {
        let result = run(&context, &spec, &inputs);
        (context, result)
    };
    tokio::task::spawn_blocking(job).await.expect("no panic")
}

/// The lines that the owner of the broken capture reads.
async fn rejected(break_it: impl FnOnce(&mut Vec<(String, Vec<u8>)>)) -> Vec<String> {
    let mut files = capture();
    break_it(&mut files);
    match ingest(files).await.1 {
        Err(JobFailure::Rejected(found)) => found.iter().map(describe).collect(),
        other => panic!("not rejected: {other:?}"),
    }
}

fn file<'a>(files: &'a mut [(String, Vec<u8>)], path: &str) -> &'a mut Vec<u8> {
    let found = files.iter_mut().find(|(name, _)| name == path);
    &mut found.expect("the capture has it").1
}

#[tokio::test]
async fn a_good_capture_becomes_a_shard_with_its_frames() {
    let (context, result) = ingest(capture()).await;
    let result = result.expect("ingested");
    assert_eq!(
        (result.frames, result.width, result.height),
        (3, SIDE, SIDE)
    );
    let object = result.shard.expect("a shard");
    assert_eq!(object.key, "captures/c/test-3/shard.bin");
    let shard = Shard::from_bytes(context.objects.get(&object).await.expect("stored").to_vec())
        .expect("reads");
    let image = shard.image(1);
    let middle = (SIDE / 2 * SIDE + SIDE / 2) as usize;
    assert_eq!(image.mask[middle], 255);
    assert_eq!(image.rgb[3 * middle..3 * middle + 3], [200, 8, 50]);
    assert_eq!(context.progress.borrow().phase, "decoding");
    let check = result.check.expect("a report");
    assert_eq!(check.key, "captures/c/test-3/check.json");
    let json = context.objects.get(&check).await.expect("stored");
    let report: Report = serde_json::from_slice(&json).expect("reads");
    assert_eq!((report.frames, report.looked_at), (3, 3));
    let views = |line: &String| line.starts_with("view coverage: 1 of 12");
    assert!(result.warnings.iter().any(views), "{:?}", result.warnings);
}

#[tokio::test]
async fn poses_that_miss_every_mask_are_refused_with_the_reason() {
    let found = rejected(|files| {
        let track = file(files, FILE);
        let mut json: serde_json::Value = serde_json::from_slice(track).expect("JSON");
        for frame in json["frames"].as_array_mut().expect("frames") {
            frame["E"][0][3] = 900.0.into();
        }
        *track = serde_json::to_vec(&json).expect("JSON");
    })
    .await;
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(
        found[0].starts_with("poses.json: joints in the mask: 0.0 %"),
        "{found:?}"
    );
}

#[tokio::test]
async fn a_corrupt_mask_is_named_by_file_and_frame() {
    let found = rejected(|files| file(files, "masks/000008.png").truncate(40)).await;
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(
        found[0].starts_with("masks/000008.png frame 8: "),
        "{found:?}"
    );
}

#[tokio::test]
async fn every_broken_frame_is_named_not_just_the_first() {
    let found = rejected(|files| {
        *file(files, "frames/000007.png") = b"no picture".to_vec();
        *file(files, "masks/000009.png") = mask(SIDE / 2, 255);
    })
    .await;
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

#[tokio::test]
async fn a_corrupt_pose_is_named_by_frame_and_field() {
    let found = rejected(|files| {
        let track = file(files, FILE);
        let mut json: serde_json::Value = serde_json::from_slice(track).expect("JSON");
        json["frames"][1]["translation"][2] = 1e30.into();
        *track = serde_json::to_vec(&json).expect("JSON");
    })
    .await;
    assert!(
        found[0].starts_with("poses.json frame 8: translation[2]: "),
        "{found:?}"
    );
}

#[tokio::test]
async fn missing_files_are_named() {
    let found = rejected(|files| {
        files.retain(|(path, _)| path != "masks/000009.png" && path != "frames/000007.png")
    })
    .await;
    assert!(
        found[0].starts_with("frames/000007.png frame 7: "),
        "{found:?}"
    );
    assert!(
        found[1].starts_with("masks/000009.png frame 9: "),
        "{found:?}"
    );
    let found = rejected(|files| files.retain(|(path, _)| path != FILE)).await;
    assert!(found[0].starts_with("poses.json: "), "{found:?}");
}

#[tokio::test]
async fn a_capture_of_nobody_is_refused() {
    let found = rejected(|files| {
        for path in [7, 8, 9].map(mask_path) {
            *file(files, &path) = mask(SIDE, 0);
        }
    })
    .await;
    assert!(found[0].starts_with("masks: no mask covers"), "{found:?}");
}

#[tokio::test]
async fn an_object_that_changed_after_the_upload_is_our_fault_not_the_owner_s() {
    let context = context();
    let written = context
        .objects
        .put("uploads/c/poses.json", "{}".into())
        .await
        .expect("stored");
    context
        .objects
        .put("uploads/c/poses.json", "[]".into())
        .await
        .expect("altered");
    let inputs = Inputs {
        files: vec![InputFile {
            path: FILE.into(),
            object: Some(written),
        }],
        ..Inputs::default()
    };
    let job = move || {
        run(
            &context,
            &IngestSpec {
                capture: "captures/c".into(),
            },
            &inputs,
        )
    };
    let failure = tokio::task::spawn_blocking(job)
        .await
        .expect("no panic")
        .expect_err("altered");
    assert!(
        matches!(
            failure,
            JobFailure::Failed {
                code: "OBJECTS",
                ..
            }
        ),
        "{failure:?}"
    );
}
