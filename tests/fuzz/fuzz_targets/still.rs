//! A picture: pixels for each of its declared sides, or a fault.
#![no_main]

use libfuzzer_sys::fuzz_target;
use yoto_media::{Limits, decode_still, still_size};

fuzz_target!(|bytes: &[u8]| {
    let limits = Limits {
        side: 256,
        ..Limits::default()
    };
    if let Ok(picture) = decode_still(bytes, &limits) {
        assert_eq!(picture.rgb.len(), picture.pixels() * 3);
        assert!(
            picture
                .alpha
                .is_none_or(|alpha| alpha.len() == picture.width * picture.height)
        );
        let size = still_size(bytes, &limits).expect("a picture has a size");
        assert_eq!(size, [picture.width as u32, picture.height as u32]);
    }
});
