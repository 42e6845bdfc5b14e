//! A clip alone. The pose model is not part of the project: what needs it runs where
//! `YOTO_POSE_MODEL` names it, and fails without it where `YOTO_TEST_POSE_MODEL=required`.

use image::RgbImage;
use std::path::{Path, PathBuf};
use yoto_import::{Format, Options, TrackForm, read, write};

/// The model's folder.
pub(crate) fn model() -> Option<PathBuf> {
    let path = std::env::var_os("YOTO_POSE_MODEL").map(PathBuf::from);
    let required =
        std::env::var_os("YOTO_TEST_POSE_MODEL").is_some_and(|value| value == "required");
    assert!(
        path.is_some() || !required,
        "YOTO_POSE_MODEL names no model"
    );
    path
}

const SIZE: u32 = 320;
/// Pixels that the person moves from frame to frame.
const STEP: u32 = 8;

/// `frames` pictures of a person of the demo who moves to the right; in those in `without`,
/// nobody is.
pub(crate) fn film(folder: &Path, frames: u32, without: &[u32]) {
    let here = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let person = image::open(here.join("../../worker/landmarks/tests/person.png"));
    let person = person.expect("a picture").to_rgb8();
    let (width, height) = (2 * person.width(), 2 * person.height());
    let person = image::imageops::resize(
        &person,
        width,
        height,
        image::imageops::FilterType::Triangle,
    );
    for frame in 0..frames {
        let mut picture = RgbImage::new(SIZE, SIZE);
        if !without.contains(&frame) {
            let left = i64::from(10 + STEP * frame);
            image::imageops::replace(&mut picture, &person, left, 30);
        }
        let path = folder.join(format!("{frame:04}.png"));
        picture.save(path).expect("a picture");
    }
}

#[test]
fn without_a_pose_model_the_way_to_one_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    film(folder.path(), 1, &[]);
    let error = read(Format::AUTO, folder.path(), &Options::default());
    let error = error.expect_err("no model").to_string();
    assert!(error.contains("--pose-model"), "{error}");
    assert!(error.contains("deploy/models/get.sh"), "{error}");
    let options = Options {
        pose_model: Some(folder.path().join("nowhere.tflite")),
        ..Options::default()
    };
    let error = read(Format::FILM, folder.path(), &options);
    let error = error.expect_err("no model").to_string();
    assert!(error.contains("get.sh"), "{error}");
}

#[test]
fn a_person_is_followed_through_a_clip() {
    let Some(model) = model() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let clip = folder.path().join("clip");
    std::fs::create_dir(&clip).expect("a folder");
    film(&clip, 7, &[3]);
    let options = Options {
        pose_model: Some(model),
        fps: Some(25.0),
        height: Some(1.6),
        ..Options::default()
    };
    let imported = read(Format::AUTO, &clip, &options).expect("a capture");
    let indices: Vec<u32> = imported.track.frames.iter().map(|it| it.index).collect();
    assert_eq!(indices, [0, 1, 2, 4, 5, 6]);
    assert_eq!(imported.track.image_size, [SIZE, SIZE]);
    assert_eq!(imported.track.fps, 25.0);
    let notes = imported.notes.join("\n");
    assert!(notes.contains("nobody was found in 1 frame"), "{notes}");
    // The root moves with the person: 48 pixels in six steps of 8, seen from its distance.
    let frames = &imported.track.frames;
    let pelvis = imported.track.skeleton.rest_joints[0];
    let x = |at: usize| {
        let frame = &frames[at];
        let position: [f64; 3] = std::array::from_fn(|axis| pelvis[axis] + frame.translation[axis]);
        let [_, _, [x, y, z, by], _] = frame.e;
        let depth = x * position[0] + y * position[1] + z * position[2] + by;
        // The camera does not roll: its x is the world's.
        frame.k[0][0] * position[0] / depth + frame.k[0][2]
    };
    let moved = x(5) - x(0);
    assert!((moved - 48.0).abs() < 10.0, "{moved} pixels");

    let out = folder.path().join("capture");
    write(&imported, &out, TrackForm::Json, |_, _, _| ()).expect("a capture folder");
    let mask = image::open(out.join("masks/000002.png"))
        .expect("a mask")
        .to_luma8();
    let person = image::open(clip.join("0002.png"))
        .expect("a picture")
        .to_rgb8();
    let (mut both, mut either) = (0, 0);
    for (coverage, pixel) in mask.pixels().zip(person.pixels()) {
        let (found, drawn) = (coverage[0] > 127, pixel.0.iter().any(|level| *level > 40));
        both += usize::from(found && drawn);
        either += usize::from(found || drawn);
    }
    let share = f64::from(both as u32) / f64::from(either as u32);
    assert!(share > 0.8, "the mask shares {share} with the person");
}

#[test]
fn a_clip_without_a_person_is_refused() {
    let Some(model) = model() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    film(folder.path(), 2, &[0, 1]);
    let options = Options {
        pose_model: Some(model),
        ..Options::default()
    };
    let error = read(Format::FILM, folder.path(), &options);
    let error = error.expect_err("nobody").to_string();
    assert!(error.contains("nobody was found in 2 frames"), "{error}");
}
