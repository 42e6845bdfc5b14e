//! `yoto capture check` on a made-up person: the truth passes, and a mistake is named.

use std::path::Path;
use yoto_capture::FrameImage;
use yoto_import::Progress;
use yoto_import::capture_check::{Checked, check};
use yoto_import::capture_dir::CaptureOptions;
use yoto_proto::pose_track::FILE;
use yoto_synthetic::SyntheticPerson;

/// The sheet's colour of what failed.
const FAILURE: image::Rgb<u8> = image::Rgb([255, 90, 90]);

/// Writes a film of 24 frames as a capture.
fn write(folder: &Path) {
    let person = SyntheticPerson::cast(1, 7).remove(0);
    let (track, film) = person.capture(24, 96);
    for name in ["frames", "masks"] {
        std::fs::create_dir(folder.join(name)).expect("a folder");
    }
    for (frame, seen) in track.frames.iter().zip(film) {
        let FrameImage {
            width,
            height,
            rgb,
            mask,
        } = seen;
        let (width, height) = (width as u32, height as u32);
        let name = format!("{:06}.png", frame.index);
        let colours = image::RgbImage::from_raw(width, height, rgb).expect("three per pixel");
        let coverage = image::GrayImage::from_raw(width, height, mask).expect("one per pixel");
        colours
            .save(folder.join("frames").join(&name))
            .expect("written");
        coverage
            .save(folder.join("masks").join(&name))
            .expect("written");
    }
    let json = serde_json::to_vec(&track).expect("serialises");
    std::fs::write(folder.join(FILE), json).expect("written");
}

fn checked(folder: &Path, options: &CaptureOptions) -> Checked {
    check(folder, options, None, &Progress::default()).expect("reads")
}

#[test]
fn the_truth_passes_and_a_wrong_scale_of_k_is_named_and_marked_on_the_sheet() {
    let dir = tempfile::tempdir().expect("a folder");
    write(dir.path());
    let truth = checked(dir.path(), &CaptureOptions::default());
    assert_eq!(truth.failed(), 0, "{}", truth.text());
    assert!(truth.report.causes.is_empty(), "{}", truth.text());
    // Two turns in 24 frames.
    assert!(
        truth.text().contains("advice: the body turns by"),
        "{}",
        truth.text()
    );

    let mut options = CaptureOptions::default();
    options.correction.k_scale = 0.5;
    let wrong = checked(dir.path(), &options);
    assert!(wrong.failed() > 0, "{}", wrong.text());
    let said = wrong.text();
    let cause = said
        .lines()
        .find(|line| line.starts_with("most likely cause"));
    let cause = cause.expect("a cause");
    assert!(cause.contains("--k-scale 2"), "{said}");

    let red = |checked: &Checked| {
        let sheet = checked.sheet().expect("draws");
        sheet.pixels().filter(|pixel| **pixel == FAILURE).count()
    };
    assert_eq!(red(&truth), 0);
    assert!(red(&wrong) > 0);
}

#[test]
fn names_that_were_unified_are_told() {
    let dir = tempfile::tempdir().expect("a folder");
    write(dir.path());
    let plain = checked(dir.path(), &CaptureOptions::default()).text();
    assert!(!plain.contains("note: "), "{plain}");
    let poses = dir.path().join(FILE);
    let track = std::fs::read_to_string(&poses).expect("is there");
    let track = track.replace("\"l_", "\"left_").replace("\"r_", "\"right_");
    std::fs::write(&poses, track).expect("written");
    let said = checked(dir.path(), &CaptureOptions::default()).text();
    assert!(
        said.contains("note: 18 of the 24 joints have SMPL's names now"),
        "{said}"
    );
}
