//! Masks for key points: the person's own, somebody else's, and the detector's.

use crate::format;
use crate::key_points::{DETECTORS, files, import, options};
use yoto_import::{Options, Pictures, TrackForm, read, write};

#[test]
fn masks_are_the_person_s_own() {
    for (person, colour) in [("1", "#800000"), ("2", "#008000")] {
        let masked = Options {
            person: Some(person.into()),
            masks: Some(files("clip/masks")),
            ..options(files("alphapose/alphapose-results.json"))
        };
        let found = import(&masked);
        let notes = found.notes.join("\n");
        assert!(notes.contains(colour), "{person}: {notes}");
        let Pictures::Files(pictures) = &found.pictures else {
            panic!("the clip is a folder of pictures");
        };
        assert_eq!(pictures.len(), found.track.frames.len());
        assert!(pictures.iter().all(|picture| picture.masks.len() == 1));
    }
    let unmasked = import(&options(files("alphapose/alphapose-results.json")));
    assert!(unmasked.notes.iter().any(|note| note.contains("--masks")));
}

#[test]
fn masks_of_another_person_are_refused_and_gaps_are_said() {
    let dir = tempfile::tempdir().expect("a folder");
    for frame in 0..16 {
        let aside = |x: u32, y: u32| image::Luma([if x > 54 && y < 30 { 255 } else { 0 }]);
        let mask = image::GrayImage::from_fn(64, 96, aside);
        let path = dir.path().join(format!("{frame:06}.png"));
        mask.save(path).expect("writes");
    }
    for (path, name, has_both) in DETECTORS {
        let others = Options {
            masks: Some(dir.path().to_owned()),
            ..options(files(path))
        };
        let refused = read(format("key-points"), &files("clip/frames"), &others);
        let message = refused
            .map(|found| found.notes)
            .expect_err(name)
            .to_string();
        assert!(
            message.contains("most of the key points lie outside the masks"),
            "{path}: {message}"
        );
        if has_both {
            let second = Options {
                person: Some(if path.contains("alphapose") { "2" } else { "1" }.into()),
                ..options(files(path))
            };
            let notes = import(&second).notes.join("\n");
            assert!(
                notes.contains("7 frames without key points of the person (0–2, 12–15)"),
                "{path}: {notes}"
            );
        }
    }
}

#[test]
fn sam_3d_body_s_own_masks_are_taken() {
    let found = import(&options(files("sam_3d_body")));
    let notes = found.notes.join("\n");
    assert!(notes.contains("the detector's own"), "{notes}");
    let dir = tempfile::tempdir().expect("a folder");
    let out = dir.path().join("out");
    write(&found, &out, TrackForm::Json, |_, _, _| {}).expect("writes");
    let palette = image::open(files("clip/masks/00007.png")).expect("a mask");
    let mask = image::open(out.join("masks/000007.png")).expect("a mask");
    // The first person is in front, so that the palette's picture has all of them.
    for (pixel, colour) in mask.into_luma8().pixels().zip(palette.into_rgb8().pixels()) {
        assert_eq!(pixel.0[0] == 255, colour.0 == [128, 0, 0]);
    }
    let given = Options {
        masks: Some(files("clip/masks")),
        ..options(files("sam_3d_body"))
    };
    let notes = import(&given).notes.join("\n");
    assert!(!notes.contains("the detector's own"), "{notes}");
}
