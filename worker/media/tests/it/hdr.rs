//! Video with a high dynamic range, declared and real.

use crate::video::{FRAMES, all, check, check_within, clip, open};
use yoto_media::video::{Ffmpeg, Hdr, Video};
use yoto_media::{Limits, MediaError, Picture};

#[test]
fn hdr_becomes_ordinary_video() {
    let mut video = open(&clip("hlg.mp4")).expect("opens");
    let note = "the video is HDR (HLG, BT.2020): it is converted to ordinary video";
    assert!(video.notes()[0].starts_with(note), "{:?}", video.notes());
    let pictures = all(&mut video);
    assert_eq!(pictures.len(), FRAMES);
    for (frame, picture) in pictures.iter().enumerate() {
        check_within(9, picture, frame, "hlg.mp4");
    }
    // The first frame is looked at on opening, and may be passed over.
    let mut again = open(&clip("hlg.mp4")).expect("opens");
    assert_eq!(again.next(true).expect("decodes"), None);
    assert_eq!(
        again.next(false).expect("decodes").as_ref(),
        Some(&pictures[1])
    );
}

#[test]
fn a_declaration_alone_changes_nothing() {
    let mut video = open(&clip("declared_hlg.mp4")).expect("opens");
    assert!(
        video.notes()[0].contains("left as they are"),
        "{:?}",
        video.notes()
    );
    for (frame, picture) in all(&mut video).iter().enumerate() {
        check(picture, frame, "declared_hlg.mp4");
    }
}

/// The first picture of a clip that is taken for `hdr`, and the notes.
fn taken_for(name: &str, hdr: Hdr, ffmpeg: &Ffmpeg) -> (Picture, String) {
    let opened = Video::open_as(&clip(name), &Limits::default(), ffmpeg, true, hdr);
    let mut video = opened.expect(name);
    let picture = video.next(false).expect("decodes").expect("a frame");
    (picture, video.notes().join("\n"))
}

#[test]
fn a_declaration_is_overridden() {
    let none = Ffmpeg::none();
    let (declared, _) = taken_for("hlg.mp4", Hdr::Auto, &none);
    let (ordinary, notes) = taken_for("hlg.mp4", Hdr::Off, &none);
    let note = "the video declares HDR (HLG, BT.2020), and is taken for ordinary video";
    assert!(notes.starts_with(note), "{notes}");
    assert_ne!(declared, ordinary);
    // The levels are ordinary, and only the declaration is HLG: it is believed if the user says so.
    let (as_found, _) = taken_for("declared_hlg.mp4", Hdr::Auto, &none);
    let (converted, notes) = taken_for("declared_hlg.mp4", Hdr::Hlg, &none);
    assert!(notes.starts_with("the video is HDR (HLG"), "{notes}");
    assert_ne!(as_found, converted);
    let (pq, notes) = taken_for("hlg.mp4", Hdr::Pq, &none);
    assert!(
        notes.starts_with("the video is taken for HDR (PQ, BT.2020)"),
        "{notes}"
    );
    assert_ne!(pq, declared);
    let (plain, notes) = taken_for("baseline.mp4", Hdr::Off, &none);
    assert_eq!((plain, notes), taken_for("baseline.mp4", Hdr::Auto, &none));
    // The same with ffmpeg's decoder.
    let ffmpeg = Ffmpeg::find(None);
    let opened = Video::open(&clip("hlg.mkv"), &Limits::default(), &ffmpeg, true);
    if let Err(MediaError::Bad(fault)) = opened
        && fault.code == "NEEDS_FFMPEG"
    {
        eprintln!("no ffmpeg on this machine: its part is not run");
        return;
    }
    let (by_ffmpeg, notes) = taken_for("hlg.mkv", Hdr::Off, &ffmpeg);
    assert!(notes.starts_with(note), "{notes}");
    let far = by_ffmpeg.rgb.iter().zip(&ordinary.rgb);
    let far = far.map(|(a, b)| u64::from(a.abs_diff(*b))).sum::<u64>();
    assert!(far < 3 * ordinary.rgb.len() as u64, "{far}");
}
