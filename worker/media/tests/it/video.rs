//! Clips of a known pattern, through the decoder. `clips/make.py` generates and describes them.

use std::path::{Path, PathBuf};
use yoto_media::video::{Ffmpeg, Video};
use yoto_media::{Limits, MediaError, MediaFault, Picture};

pub(crate) const FRAMES: usize = 20;

pub(crate) fn clip(name: &str) -> PathBuf {
    PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo runs the tests"))
        .join("tests/clips")
        .join(name)
}

pub(crate) fn open(path: &Path) -> Result<Video, MediaError> {
    Video::open(path, &Limits::default(), &Ffmpeg::none(), true)
}

pub(crate) fn all(video: &mut Video) -> Vec<Picture> {
    std::iter::from_fn(|| video.next(false).expect("decodes")).collect()
}

fn fault(path: &Path, limits: &Limits) -> MediaFault {
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
pub(crate) fn check(picture: &Picture, frame: usize, name: &str) {
    check_within(6, picture, frame, name);
}

/// The same within `most` levels: those of HDR in 8 bits are coarse where it is dark.
pub(crate) fn check_within(most: i32, picture: &Picture, frame: usize, name: &str) {
    assert_eq!((picture.width, picture.height), (50, 38), "{name}");
    let pixel = |x: usize, y: usize| &picture.rgb[(y * 50 + x) * 3..][..3];
    let far = if frame < 10 { 46 } else { 3 };
    let expected = [20 + 10 * frame as i32, 100, 210 - 10 * frame as i32];
    for (found, expected) in pixel(far, 30).iter().zip(expected) {
        let off = (i32::from(*found) - expected).abs();
        assert!(off <= most, "{name} frame {frame}: {:?}", pixel(far, 30));
    }
    let bar = pixel(2 * frame + 3, 19);
    assert!(
        bar.iter().all(|&v| v > 215),
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
fn pixels_are_made_square() {
    let mut video = open(&clip("wide_pixels.mp4")).expect("opens");
    let note = "the video's pixels are 25:13, not square: its pictures of 26x38 are made 50x38";
    assert_eq!(video.notes(), [note]);
    let pictures = all(&mut video);
    for (frame, picture) in pictures.iter().enumerate() {
        check(picture, frame, "wide_pixels.mp4");
    }
    let turned = all(&mut open(&clip("wide_pixels_turned.mp4")).expect("opens"));
    assert_eq!((turned[3].width, turned[3].height), (38, 50));
    assert_eq!(turned.len(), FRAMES);
    // Captures of earlier versions are of pictures as stored.
    let mut kept = open(&clip("wide_pixels.mp4")).expect("opens");
    kept.keep_pixels_for([26, 38]);
    assert!(kept.notes()[0].contains("are kept"), "{:?}", kept.notes());
    let picture = kept.next(false).expect("decodes").expect("a frame");
    assert_eq!((picture.width, picture.height), (26, 38));
    let mut other = open(&clip("wide_pixels.mp4")).expect("opens");
    other.keep_pixels_for([50, 38]);
    assert_eq!(
        other.next(false).expect("decodes").as_ref(),
        pictures.first()
    );
}

#[test]
fn the_good_frames_of_a_cut_video_are_read() {
    for (name, least) in [("b_frames.mp4", 8), ("fragmented.mp4", 12)] {
        let bytes = fast_start(&std::fs::read(clip(name)).expect("reads"));
        let whole = all(&mut open(scratch(&bytes).path()).expect("opens"));
        let mut found = Vec::new();
        for length in (bytes.len() / 2..bytes.len()).step_by(23) {
            let file = scratch(&bytes[..length]);
            let mut video = match open(file.path()) {
                Ok(video) => video,
                Err(MediaError::Bad(fault)) if found.is_empty() => {
                    assert_eq!(fault.code, "TRUNCATED", "{name}, {length} bytes: {fault}");
                    continue;
                }
                Err(error) => panic!("{name}, {length} bytes: {error}"),
            };
            let frames = video.frames().expect("known");
            let note = video.notes().first().cloned().unwrap_or_default();
            assert!(
                frames == FRAMES || note.contains(&format!("its first {frames} frames are read")),
                "{name}, {length} bytes: {note}"
            );
            assert_eq!(all(&mut video), whole[..frames], "{name}, {length} bytes");
            found.push(frames);
        }
        assert!(found.is_sorted(), "{found:?}");
        assert!(
            found.iter().any(|frames| (least..FRAMES).contains(frames)),
            "{found:?}"
        );
    }
}

/// The file with its `moov` before its `mdat`, as recorders of streams write it; as it is, if that is so already.
fn fast_start(bytes: &[u8]) -> Vec<u8> {
    let at = |name: &[u8]| bytes.windows(4).position(|it| it == name).expect("has one") - 4;
    let (mdat, moov) = (at(b"mdat"), at(b"moov"));
    if moov < mdat {
        return bytes.to_vec();
    }
    let mut header = bytes[moov..].to_vec();
    let by = header.len() as u32;
    // Version and count, then the chunks' places, which all move.
    let table = header
        .windows(4)
        .position(|it| it == b"stco")
        .expect("has one")
        + 8;
    let count = u32::from_be_bytes(header[table..table + 4].try_into().expect("four")) as usize;
    for entry in 0..count {
        let place = &mut header[table + 4 + 4 * entry..][..4];
        let moved = u32::from_be_bytes(place.try_into().expect("four")) + by;
        place.copy_from_slice(&moved.to_be_bytes());
    }
    [&bytes[..mdat], &header, &bytes[mdat..moov]].concat()
}

#[test]
fn ffmpeg_gives_the_same_light_and_the_same_pixels() {
    let ffmpeg = Ffmpeg::find(None);
    let open = |name: &str| Video::open(&clip(name), &Limits::default(), &ffmpeg, true);
    let Ok(mut by_ffmpeg) = open("hlg.mkv") else {
        eprintln!("no ffmpeg on this machine: its part is not run");
        return;
    };
    let mut here = open("hlg.mp4").expect("opens");
    assert_eq!(by_ffmpeg.notes(), here.notes());
    for (frame, (one, other)) in all(&mut by_ffmpeg).iter().zip(all(&mut here)).enumerate() {
        // Chroma is interpolated in different ways at the bar's edges.
        for x in [if frame < 10 { 46 } else { 3 }, 2 * frame + 3] {
            let [one, other] = [one, &other].map(|it| &it.rgb[(19 * 50 + x) * 3..][..3]);
            let mut pairs = one.iter().zip(other);
            assert!(
                pairs.all(|(a, b)| a.abs_diff(*b) <= 5),
                "frame {frame}: {one:?}, {other:?}"
            );
        }
    }
    for name in ["hlg.mkv", "hlg_hevc.mov", "pq_hevc.mp4", "wide_pixels.avi"] {
        let mut video = open(name).expect(name);
        assert_eq!(video.notes().len(), 1, "{name}: {:?}", video.notes());
        assert_eq!(video.frames(), Some(FRAMES), "{name}");
        for (frame, picture) in all(&mut video).iter().enumerate() {
            check_within(9, picture, frame, name);
        }
    }
    let bytes = fast_start(&std::fs::read(clip("hevc.mp4")).expect("reads"));
    let cut = scratch(&bytes[..bytes.len() - 300]);
    let mut video = Video::open(cut.path(), &Limits::default(), &ffmpeg, true).expect("opens");
    let frames = video.frames().expect("known");
    assert!(
        frames < FRAMES && video.notes()[0].contains("cut short"),
        "{:?}",
        video.notes()
    );
    assert_eq!(all(&mut video).len(), frames);
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

#[test]
fn ffmpeg_decodes_no_codec_that_cameras_do_not_write() {
    let ffmpeg = Ffmpeg::find(None);
    if ffmpeg.program().is_none() {
        eprintln!("no ffmpeg on this machine: its part is not run");
        return;
    }
    let limits = Limits::default();
    let read = Video::open(&clip("flashsv.mkv"), &limits, &ffmpeg, false)
        .and_then(|mut video| video.next(false))
        .map(drop);
    let error = read.expect_err("a codec of screens");
    let said = error.to_string();
    assert!(said.contains("its codec is flashsv; those"), "{said}");
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
