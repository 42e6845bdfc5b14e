//! A training shard: frames whose pixels are all inside the bytes, or an error.
#![no_main]

use libfuzzer_sys::fuzz_target;
use yoto_capture::Shard;

/// Most pixels of a frame that is unfolded to its full size.
const PIXELS: usize = 1 << 16;

fuzz_target!(|bytes: &[u8]| {
    let Ok(shard) = Shard::from_bytes(bytes) else {
        return;
    };
    assert_eq!(shard.to_bytes(), bytes);
    assert_eq!(shard.frames(), shard.track.frames.len());
    let [width, height] = shard.track.image_size.map(|side| side as usize);
    for frame in 0..shard.frames() {
        let (rect, rgb, mask) = shard.crop(frame);
        let pixels = rect.width as usize * rect.height as usize;
        assert_eq!((rgb.len(), mask.len()), (3 * pixels, pixels));
        if width * height <= PIXELS {
            let image = shard.image(frame);
            assert_eq!(
                (image.rgb.len(), image.mask.len()),
                (3 * width * height, width * height)
            );
        }
    }
});
