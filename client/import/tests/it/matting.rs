//! Masks by a matting model: tiny networks in real files, over whole imports.

use crate::film::{film, model};
use crate::networks::{Network, bright};
use crate::pose_tools::{files, indices, options};
use std::path::{Path, PathBuf};
use yoto_import::{Format, Levels, MattingModel, Options, TrackForm, read, write};

/// Writes `network`, which expects pictures with `levels`, to a file in `folder`.
fn matting(folder: &Path, network: Network, levels: Option<Levels>) -> Option<MattingModel> {
    let path = folder.join("matting.onnx");
    network.write(&path);
    Some(MattingModel { path, levels })
}

/// The share of pixels that are in both of what a mask covers and `is_person` says, among those in
/// either.
fn overlap(mask: &Path, is_person: impl Fn(u32, u32) -> bool) -> f64 {
    let mask = image::open(mask).expect("a mask").to_luma8();
    let (mut both, mut either) = (0, 0);
    for (x, y, coverage) in mask.enumerate_pixels() {
        let (found, drawn) = (coverage[0] > 127, is_person(x, y));
        both += u32::from(found && drawn);
        either += u32::from(found || drawn);
    }
    f64::from(both) / f64::from(either)
}

/// The frames of a clip alone that has one person over black.
fn clip(folder: &Path, frames: u32, without: &[u32]) -> PathBuf {
    let clip = folder.join("clip");
    std::fs::create_dir(&clip).expect("a folder");
    film(&clip, frames, without);
    clip
}

#[test]
fn a_clip_alone_gets_the_masks_of_the_matting_model() {
    let Some(pose_model) = model() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let clip = clip(folder.path(), 4, &[]);
    let options = Options {
        pose_model: Some(pose_model),
        fps: Some(25.0),
        matting: matting(folder.path(), bright(0, 0), None),
        ..Options::default()
    };
    let imported = read(Format::AUTO, &clip, &options).expect("a capture");
    let notes = imported.notes.join("\n");
    assert!(
        notes.contains("masks by matting.onnx (levels signed): 4 frames,"),
        "{notes}"
    );
    assert!(notes.contains(" a second"), "{notes}");
    assert!(
        notes.contains("by the levels of its pictures: signed "),
        "{notes}"
    );
    assert!(!notes.contains("are the pose model's:"), "{notes}");
    let out = folder.path().join("capture");
    write(&imported, &out, TrackForm::Json, |_, _, _| ()).expect("a capture folder");
    let picture = image::open(clip.join("0002.png"))
        .expect("a picture")
        .to_rgb8();
    let share = overlap(&out.join("masks/000002.png"), |x, y| {
        picture.get_pixel(x, y).0.iter().any(|level| *level > 38)
    });
    // The pose model's own masks share four fifths.
    assert!(share > 0.95, "the mask shares {share} with the person");
}

#[test]
fn a_model_that_sees_another_person_is_refused() {
    let Some(pose_model) = model() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let clip = clip(folder.path(), 1, &[]);
    // What is dark is the person, with any levels.
    let dark = Network::default()
        .input("input", &[1, 3, 0, 0])
        .constant("steep", -20.0)
        .constant("bright", -5.0)
        .node("ReduceMax", &["input"], "brightest")
        .with("axes", &[1])
        .node("Mul", &["brightest", "steep"], "steeper")
        .node("Add", &["steeper", "bright"], "output")
        .output("output", &[1, 1, 0, 0]);
    let options = Options {
        pose_model: Some(pose_model),
        matting: matting(folder.path(), dark, None),
        ..Options::default()
    };
    let error = read(Format::AUTO, &clip, &options).expect_err("another person");
    let error = error.to_string();
    assert!(
        error.contains("matting.onnx") && error.contains("with any levels"),
        "{error}"
    );
}

/// Sees what is brighter than the background of the pose tools' clip, and grows it over the gaps between
/// the bodies' bones.
fn bodies() -> Network {
    Network::default()
        .input("input", &[1, 3, 96, 64])
        .constant("steep", 10.0)
        .constant("dark", -1.5)
        .node("ReduceMax", &["input"], "brightest")
        .with("axes", &[1])
        .node("MaxPool", &["brightest"], "grown")
        .with("kernel_shape", &[3, 3])
        .with("pads", &[1, 1, 1, 1])
        .with("strides", &[1, 1])
        .node("Mul", &["grown", "steep"], "steeper")
        .node("Add", &["steeper", "dark"], "levels")
        .node("Sigmoid", &["levels"], "alpha")
        .output("alpha", &[1, 1, 96, 64])
}

#[test]
fn a_pose_tool_s_poses_are_held_against_the_matting_model_s_masks() {
    let folder = tempfile::tempdir().expect("a folder");
    let options = |levels, frames| Options {
        masks: None,
        matting: matting(folder.path(), bodies(), levels),
        frames,
        ..options(folder.path(), files("wham/output/demo/walk"))
    };
    let clip = files("clip/frames");
    let imported = read(
        Format::AUTO,
        &clip,
        &options(Some(Levels::Signed), Some((0, 16, 2))),
    );
    let imported = imported.expect("imports");
    assert_eq!(indices(&imported.track), [0, 2, 4, 6, 8, 10, 12, 14]);
    let notes = imported.notes.join("\n");
    assert!(
        notes.contains("masks by matting.onnx (levels signed): 8 frames,"),
        "{notes}"
    );
    let out = folder.path().join("capture");
    write(&imported, &out, TrackForm::Json, |_, _, _| ()).expect("a capture folder");
    // Labels of two people: 1 is the one whom the model, too, takes.
    let labels = image::open(files("clip/masks/00004.png"))
        .expect("labels")
        .to_rgb8();
    let person = *labels.get_pixel(20, 40);
    let share = overlap(&out.join("masks/000004.png"), |x, y| {
        *labels.get_pixel(x, y) == person
    });
    assert!(share > 0.5, "{share}");

    let error = read(Format::AUTO, &clip, &options(None, None)).expect_err("no levels");
    let error = error.to_string();
    assert!(
        error.contains("--matting-levels") && error.contains("imagenet"),
        "{error}"
    );
}

#[test]
fn a_file_that_is_no_matting_model_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("matting.onnx");
    let options = |levels| Options {
        masks: None,
        matting: Some(MattingModel {
            path: path.clone(),
            levels,
        }),
        ..options(folder.path(), files("wham/output/demo/walk"))
    };
    let import = |levels| {
        let imported = read(Format::AUTO, &files("clip/frames"), &options(levels));
        imported.expect_err("refused").to_string()
    };
    let error = import(Some(Levels::Unit));
    assert!(
        error.contains("matting.onnx") && error.contains("No such file"),
        "{error}"
    );
    std::fs::write(&path, "no network").expect("a file");
    let error = import(Some(Levels::Unit));
    assert!(error.contains("not an ONNX file"), "{error}");
    let blank = Network::default()
        .input("input", &[1, 3, 96, 64])
        .constant("zero", 0.0)
        .node("ReduceMax", &["input"], "brightest")
        .with("axes", &[1])
        .node("Mul", &["brightest", "zero"], "output")
        .output("output", &[1, 1, 96, 64]);
    blank.write(&path);
    let error = import(Some(Levels::Unit));
    assert!(error.contains("finds nobody in 16 frames"), "{error}");
    let wrong = Network::default()
        .input("input", &[1, 3, 96, 64])
        .node("ReduceMax", &["input"], "brightest")
        .with("axes", &[1])
        .node("Div", &["brightest", "brightest"], "one")
        .node("Sub", &["brightest", "brightest"], "nothing")
        .node("Div", &["one", "nothing"], "output")
        .output("output", &[1, 1, 96, 64]);
    wrong.write(&path);
    let error = import(Some(Levels::Unit));
    assert!(
        error.contains("frame 0 of the clip: ") && error.contains("output is inf"),
        "{error}"
    );
}
