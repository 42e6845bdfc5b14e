//! Clips of still poses and blurred frames, as pictures and as a video.

use super::*;
use crate::track::empty_track;
use crate::{Mask, MaskKind, PictureFiles};
use std::path::PathBuf;
use yoto_proto::pose_track::{Frame, Skeleton};

const SIDE: u32 = 32;

/// A clip whose frames have the arm at these angles, as pictures of stripes; those of `blurred` have
/// weaker ones.
fn clip(folder: &Path, angles: &[f64], blurred: &[usize]) -> Imported {
    let mask = folder.join("mask.png");
    let inside = image::GrayImage::from_pixel(SIDE, SIDE, image::Luma([255]));
    inside.save(&mask).expect("writes");
    let picture = |at: usize| {
        let path = folder.join(format!("{at}.png"));
        let light = if blurred.contains(&at) { 110 } else { 200 };
        let stripes = |x: u32, _| {
            image::Rgb(
                [if (x / 2).is_multiple_of(2) {
                    light
                } else {
                    100
                }; 3],
            )
        };
        let picture = image::RgbImage::from_fn(SIDE, SIDE, stripes);
        picture.save(&path).expect("writes");
        PictureFiles {
            image: path,
            masks: vec![Mask::Image(mask.clone(), MaskKind::Coverage)],
            over_black: true,
        }
    };
    let files = (0..angles.len()).map(picture).collect();
    let skeleton = Skeleton {
        names: ["root", "arm", "hand"].map(String::from).to_vec(),
        parents: vec![-1, 0, 1],
        rest_joints: vec![[0.0; 3], [0.2, 0.0, 0.0], [0.6, 0.0, 0.0]],
    };
    let mut track = empty_track(skeleton, [SIDE, SIDE], 30.0);
    let frame = |(at, angle): (usize, &f64)| Frame {
        index: at as u32,
        pose: [[0.0; 3], [0.0, 0.0, *angle], [0.0; 3]].concat(),
        translation: [0.0; 3],
        k: [[30.0, 0.0, 16.0], [0.0, 30.0, 16.0], [0.0, 0.0, 1.0]],
        e: std::array::from_fn(|i| std::array::from_fn(|j| f64::from(i == j))),
    };
    track.frames = angles.iter().enumerate().map(frame).collect();
    Imported {
        track,
        pictures: Pictures::Files(files),
        available: angles.len(),
        notes: Vec::new(),
        found: crate::Findings::default(),
    }
}

fn count(count: usize) -> NonZeroUsize {
    NonZeroUsize::new(count).expect("is above 0")
}

fn indices(imported: &Imported) -> Vec<u32> {
    imported.track.frames.iter().map(|it| it.index).collect()
}

#[test]
fn a_still_pose_is_taken_once_and_a_blurred_frame_loses_to_its_neighbour() {
    let folder = tempfile::tempdir().expect("a folder");
    // Frames 0 to 3 and 6 to 9 stand still; the arm passes 0.8 radians in frames 4 and 5.
    let angles = [0.0, 0.0, 0.0, 0.0, 0.8, 0.82, 1.6, 1.6, 1.6, 1.6];
    for (blurred, expected) in [
        (&[][..], [0, 4, 6]),
        (&[0, 4, 6][..], [1, 5, 7]),
        (&[0, 1, 5, 9][..], [2, 4, 6]),
    ] {
        let mut clip = clip(folder.path(), &angles, blurred);
        let mut seen = Vec::new();
        choose(&mut clip, count(3), None, |done, of| seen.push((done, of))).expect("chooses");
        assert_eq!(indices(&clip), expected, "without {blurred:?}");
        assert_eq!(seen.last(), Some(&(10, 10)));
        let Pictures::Files(files) = &clip.pictures else {
            panic!("pictures");
        };
        let names: Vec<PathBuf> = files.iter().map(|it| it.image.clone()).collect();
        let own = expected.map(|at| folder.path().join(format!("{at}.png")));
        assert_eq!(names, own, "each frame keeps its picture");
        assert_eq!(
            clip.notes,
            ["3 of 10 frames are taken, by pose, view and sharpness"]
        );
    }
}

#[test]
fn more_than_there_are_is_told_and_takes_all() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut clip = clip(folder.path(), &[0.0, 1.0], &[]);
    choose(&mut clip, count(9), None, |_, _| {}).expect("chooses");
    assert_eq!(indices(&clip), [0, 1]);
    assert!(clip.notes[0].contains("best 9 frames"), "{:?}", clip.notes);
}

#[test]
fn a_video_is_decoded_and_keeps_the_masks_of_its_frames() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo runs the tests"));
    let video = here.join("../../worker/media/tests/clips/b_frames.mp4");
    // The clip's 20 frames of 50x38 pixels show a white bar from column twice the frame's number.
    let angles: Vec<f64> = (0..20).map(|at| if at < 10 { 0.0 } else { 1.0 }).collect();
    let mut clip = clip(folder.path(), &angles, &[]);
    clip.track.image_size = [50, 38];
    let is_plain = |at: u32| at < 3 || (10..14).contains(&at);
    let mask = |at: u32| {
        let path = folder.path().join(format!("mask{at}.png"));
        // Few frames show nothing of their bar inside their mask: a plain colour.
        let from = if is_plain(at) {
            (2 * at + 20) % 40
        } else {
            2 * at
        };
        let bar = |x: u32, _| image::Luma([255 * u8::from((from..from + 8).contains(&x))]);
        image::GrayImage::from_fn(50, 38, bar)
            .save(&path)
            .expect("writes");
        vec![Mask::Image(path, MaskKind::Coverage)]
    };
    let masks: Vec<Vec<Mask>> = (0..20).map(mask).collect();
    clip.pictures = Pictures::Video {
        video: video.clone(),
        masks,
    };
    let mut wrong_size = clip.clone();
    let mut too_long = clip.clone();
    choose(&mut clip, count(2), None, |_, _| {}).expect("chooses");
    let [first, second] = indices(&clip)[..] else {
        panic!("two frames: {:?}", indices(&clip));
    };
    assert!(
        first < 10 && second >= 10,
        "one of each pose: {first}, {second}"
    );
    assert!(!is_plain(first) && !is_plain(second), "{first}, {second}");
    let Pictures::Video { masks, .. } = &clip.pictures else {
        panic!("a video");
    };
    let names: Vec<_> = masks.iter().flatten().map(|it| format!("{it:?}")).collect();
    for (name, frame) in names.iter().zip([first, second]) {
        assert!(name.contains(&format!("mask{frame}.png")), "{names:?}");
    }

    wrong_size.track.image_size = [50, 40];
    let error = choose(&mut wrong_size, count(2), None, |_, _| {}).expect_err("other pictures");
    assert!(
        error.to_string().contains("b_frames.mp4 frame 0: 50x38"),
        "{error}"
    );
    too_long.track.frames[19].index = 25;
    let error = choose(&mut too_long, count(2), None, |_, _| {}).expect_err("no such frame");
    assert!(
        error.to_string().contains("b_frames.mp4 frame 25"),
        "{error}"
    );
}
