//! An MP4: the demultiplexer, and the H.264 decoder on the first frames.
#![no_main]

use libfuzzer_sys::fuzz_target;
use yoto_media::Limits;
use yoto_media::video::{Ffmpeg, Video};

fuzz_target!(|bytes: &[u8]| {
    let limits = Limits {
        side: 256,
        frames: 1000,
        file_bytes: 1 << 20,
        ..Limits::default()
    };
    let Ok(file) = tempfile::NamedTempFile::new() else { return };
    if std::fs::write(file.path(), bytes).is_err() {
        return;
    }
    let Ok(mut video) = Video::open(file.path(), &limits, &Ffmpeg::none(), true) else {
        return;
    };
    assert!(video.times().is_sorted());
    for _ in 0..8 {
        match video.next(false) {
            Ok(Some(picture)) => assert_eq!(picture.rgb.len(), picture.pixels() * 3),
            Ok(None) | Err(_) => break,
        }
    }
});
