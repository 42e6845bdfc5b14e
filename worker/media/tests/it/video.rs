//! Clips of a known pattern, through the decoder. `clips/make.py` generates and describes them.

use std::path::{Path, PathBuf};
use yoto_media::video::{Ffmpeg, Video};
use yoto_media::{Fault, Limits, MediaError, Picture};

const FRAMES: usize = 20;

fn clip(name: &str) -> PathBuf {
    PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo runs the tests"))
        .join("tests/clips")
        .join(name)
}

fn open(path: &Path) -> Result<Video, MediaError> {
    Video::open(path, &Limits::default(), &Ffmpeg::none(), true)
}

fn all(video: &mut Video) -> Vec<Picture> {
    std::iter::from_fn(|| video.next(false).expect("decodes")).collect()
}

fn fault(path: &Path, limits: &Limits) -> Fault {
    let mut video = match Video::open(path, limits, &Ffmpeg::none(), false) {
        Ok(video) => video,
        Err(MediaError::Bad(fault)) => return fault,
        Err(other) => panic!("{other}"),
    };
    loop {
        match video.next(false) {
            Ok(Some(_)) => {}
            Ok(None) => panic!("the whole clip was decoded"),
            Err(MediaError::Bad(fault)) => return fault,
            Err(other) => panic!("{other}"),
        }
    }
}

/// The frame's colour outside the bar, and the column where the bar starts.
fn check(picture: &Picture, frame: usize, name: &str) {
    assert_eq!((picture.width, picture.height), (50, 38), "{name}");
    let pixel = |x: usize, y: usize| &picture.rgb[(y * 50 + x) * 3..][..3];
    let far = if frame < 10 { 46 } else { 3 };
    let expected = [20 + 10 * frame as i32, 100, 210 - 10 * frame as i32];
    for (found, expected) in pixel(far, 30).iter().zip(expected) {
        let off = (i32::from(*found) - expected).abs();
        assert!(off <= 6, "{name} frame {frame}: {:?}", pixel(far, 30));
    }
    let bar = pixel(2 * frame + 3, 19);
    assert!(
        bar.iter().all(|&v| v > 235),
        "{name} frame {frame}: bar {bar:?}"
    );
}

#[test]
fn every_kind_of_stream_comes_out_in_the_order_shown() {
    let names = [
        "baseline.mp4",
        "b_frames.mp4",
        "b_frames.mov",
        "fragmented.mp4",
        "pauses.mp4",
    ];
    for name in names {
        let mut video = open(&clip(name)).expect(name);
        assert_eq!(video.frames(), Some(FRAMES), "{name}");
        let pictures = all(&mut video);
        assert_eq!(pictures.len(), FRAMES, "{name}");
        for (frame, picture) in pictures.iter().enumerate() {
            check(picture, frame, name);
        }
    }
}

#[test]
fn headers_tell_the_end_of_any_mp4() {
    let end = |name: &str| yoto_media::video::end(&clip(name), &Limits::default());
    for name in ["b_frames.mp4", "b_frames.mov", "fragmented.mp4", "hevc.mp4"] {
        let found = end(name).expect(name).expect("an MP4");
        assert_eq!(found.frames, FRAMES, "{name}");
        assert!(
            (found.seconds - 19.0 / 15.0).abs() < 1e-3,
            "{name}: {found:?}"
        );
    }
    let paused = end("pauses.mp4").expect("reads").expect("an MP4");
    assert_eq!(paused.frames, FRAMES);
    assert!((paused.seconds - 28.0 / 15.0).abs() < 1e-3, "{paused:?}");
    assert_eq!(end("mjpeg.avi").expect("reads"), None);
    let folder = tempfile::tempdir().expect("a folder");
    let cut = folder.path().join("cut.mp4");
    let whole = std::fs::read(clip("b_frames.mp4")).expect("is there");
    std::fs::write(&cut, &whole[..whole.len() / 2]).expect("writes");
    assert!(yoto_media::video::end(&cut, &Limits::default()).is_err());
}

#[test]
fn frames_that_are_passed_over_change_nothing_in_those_that_are_not() {
    let whole = all(&mut open(&clip("b_frames.mp4")).expect("opens"));
    let mut video = open(&clip("b_frames.mp4")).expect("opens");
    for (frame, expected) in whole.iter().enumerate() {
        let wanted = frame % 3 == 2;
        let found = video.next(!wanted).expect("decodes");
        if wanted {
            assert_eq!(found.as_ref(), Some(expected), "frame {frame}");
        }
    }
}

#[test]
fn times_follow_a_variable_frame_rate() {
    let video = open(&clip("pauses.mp4")).expect("opens");
    for (frame, &time) in video.times().iter().enumerate() {
        let expected = (frame + frame / 5 * 3) as f64 / 15.0;
        assert!(
            (time - expected).abs() < 2e-3,
            "frame {frame}: {time}, not {expected}"
        );
    }
}

#[test]
fn a_display_matrix_turns_the_picture() {
    let mut video = open(&clip("turned_right.mp4")).expect("opens");
    let turned = all(&mut video);
    let plain = all(&mut open(&clip("b_frames.mp4")).expect("opens"));
    assert_eq!((turned[3].width, turned[3].height), (38, 50));
    // The bar's columns become rows, from the top.
    for (turned, plain) in turned.iter().zip(&plain) {
        for y in 0..50 {
            for x in 0..38 {
                let from = ((37 - x) * 50 + y) * 3;
                assert_eq!(
                    turned.rgb[(y * 38 + x) * 3..][..3],
                    plain.rgb[from..from + 3]
                );
            }
        }
    }
}

#[test]
fn what_needs_ffmpeg_says_so() {
    for (name, what) in [
        ("hevc.mp4", "'hvc1' video in MP4"),
        ("mjpeg.avi", "an AVI video"),
        ("yuv422.mp4", "chroma format 2"),
    ] {
        let fault = fault(&clip(name), &Limits::default());
        assert_eq!(fault.code, "NEEDS_FFMPEG", "{name}");
        assert!(
            fault.message.contains(what) && fault.message.contains("ffmpeg"),
            "{fault}"
        );
    }
}

#[test]
fn ffmpeg_decodes_the_rest_where_it_is_installed() {
    let ffmpeg = Ffmpeg::find(None);
    if Video::open(&clip("hevc.mp4"), &Limits::default(), &ffmpeg, false).is_err() {
        eprintln!("no ffmpeg on this machine: its part is not run");
        return;
    }
    for name in ["hevc.mp4", "mjpeg.avi", "yuv422.mp4"] {
        let mut video = Video::open(&clip(name), &Limits::default(), &ffmpeg, true).expect(name);
        assert_eq!(video.times().len(), FRAMES, "{name}");
        let mut frames = 0;
        while let Some(picture) = video.next(false).expect(name) {
            check(&picture, frames, name);
            frames += 1;
        }
        assert_eq!(frames, FRAMES, "{name}");
    }
}

fn scratch(bytes: &[u8]) -> tempfile::NamedTempFile {
    let file = tempfile::NamedTempFile::new().expect("a file");
    std::fs::write(file.path(), bytes).expect("writes");
    file
}

#[test]
fn cut_and_empty_videos_are_named() {
    let bytes = std::fs::read(clip("b_frames.mp4")).expect("reads");
    let limits = Limits::default();
    assert_eq!(fault(scratch(&[]).path(), &limits).code, "EMPTY");
    assert_eq!(
        fault(scratch(b"no video").path(), &limits).code,
        "UNDECODABLE"
    );
    // The headers are after the frames, so a cut removes them.
    let cut = fault(scratch(&bytes[..bytes.len() / 2]).path(), &limits);
    assert!(
        cut.code == "UNDECODABLE" && cut.message.contains("cut short"),
        "{cut}"
    );
    for length in (1..bytes.len()).step_by(37) {
        fault(scratch(&bytes[..length]).path(), &limits);
    }
}

#[test]
fn a_million_frames_are_refused_by_the_header() {
    let few = Limits {
        frames: FRAMES - 1,
        ..Limits::default()
    };
    for name in ["b_frames.mp4", "fragmented.mp4"] {
        let refused = fault(&clip(name), &few);
        assert!(
            refused.code == "TOO_LARGE" && refused.message.contains("19 frames"),
            "{refused}"
        );
    }
    // The count in 'stsz' (version, size of all, count) set to a million, and one size for all.
    let mut bytes = std::fs::read(clip("b_frames.mp4")).expect("reads");
    let at = bytes
        .windows(4)
        .position(|it| it == b"stsz")
        .expect("has one")
        + 8;
    bytes[at..at + 4].copy_from_slice(&1u32.to_be_bytes());
    bytes[at + 4..at + 8].copy_from_slice(&1_000_000u32.to_be_bytes());
    let refused = fault(scratch(&bytes).path(), &Limits::default());
    assert_eq!(refused.code, "TOO_LARGE", "{refused}");
}

#[test]
fn too_many_pixels_are_refused_before_a_frame_is_decoded() {
    let small = Limits {
        side: 49,
        ..Limits::default()
    };
    assert_eq!(fault(&clip("baseline.mp4"), &small).code, "TOO_LARGE");
}

#[test]
fn no_flipped_byte_of_the_headers_panics_or_hangs() {
    for name in ["b_frames.mp4", "fragmented.mp4"] {
        let bytes = std::fs::read(clip(name)).expect("reads");
        let moov = bytes
            .windows(4)
            .position(|it| it == b"moov")
            .expect("has one");
        let end = bytes.len().min(moov + 1200);
        for at in (moov..end).step_by(2) {
            for value in [0, 1, 0x7f, 0xff] {
                let mut flipped = bytes.clone();
                flipped[at] = value;
                // Any answer is valid. Frames are not changed here: the decoder has its own tests.
                let _ = open(scratch(&flipped).path());
            }
        }
    }
}
