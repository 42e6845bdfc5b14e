//! Decodes the picture behind a scene within limits.

use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits, RgbImage};
use std::io::Cursor;
use yoto_proto::checks::scene::{BACKDROP_PIXELS, BACKDROP_SIDE};

/// Bytes of a pixel in memory, with 16 bits for each of four channels.
const WIDEST_PIXEL: u64 = 8;
/// Bytes that a decoder may allocate besides the pixels.
const DECODER_SLACK: u64 = 16 << 20;

/// Decodes a PNG or JPEG. Its size is checked first: a file of 3 kB can declare 10^12 pixels.
///
/// # Errors
/// The fault of the picture, for its sender.
pub fn decode(bytes: &[u8]) -> Result<RgbImage, String> {
    let format = image::guess_format(bytes).map_err(|error| error.to_string())?;
    if !matches!(format, ImageFormat::Png | ImageFormat::Jpeg) {
        return Err(format!("is {format:?}: PNG and JPEG are allowed"));
    }
    let undecodable = |error: ImageError| format!("can't be decoded: {error}");
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    // The size has its own limits, with a better message.
    reader.no_limits();
    let mut decoder = reader.into_decoder().map_err(undecodable)?;
    let (width, height) = decoder.dimensions();
    let pixels = u64::from(width) * u64::from(height);
    if width.max(height) > BACKDROP_SIDE || pixels > BACKDROP_PIXELS {
        return Err(format!(
            "{width}x{height} pixels: at most {BACKDROP_SIDE} on a side and {BACKDROP_PIXELS} in all are allowed"
        ));
    }
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(pixels * WIDEST_PIXEL + DECODER_SLACK);
    decoder.set_limits(limits).map_err(undecodable)?;
    let picture = DynamicImage::from_decoder(decoder).map_err(undecodable)?;
    Ok(picture.into_rgb8())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encode(width: u32, height: u32, format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        let picture = DynamicImage::from(RgbImage::new(width, height));
        picture.write_to(&mut bytes, format).expect("encodes");
        bytes.into_inner()
    }

    #[test]
    fn png_and_jpeg_are_read_and_nothing_else() {
        for format in [ImageFormat::Png, ImageFormat::Jpeg] {
            let picture = decode(&encode(7, 5, format)).expect("decodes");
            assert_eq!((picture.width(), picture.height()), (7, 5), "{format:?}");
        }
        let refused = decode(&encode(7, 5, ImageFormat::Gif)).expect_err("is a GIF");
        assert!(refused.contains("PNG and JPEG"), "{refused}");
        decode(&[1, 2, 3]).expect_err("is no picture");
    }

    #[test]
    fn long_and_large_pictures_are_refused_by_their_size() {
        decode(&encode(BACKDROP_SIDE, 1, ImageFormat::Png)).expect("is just short enough");
        let large = u32::try_from(BACKDROP_PIXELS / 4096 + 1).expect("fits");
        for (width, height) in [
            (BACKDROP_SIDE + 1, 1),
            (1_000_000, 1),
            (1, 1_000_000),
            (large, 4096),
        ] {
            let refused = decode(&encode(width, height, ImageFormat::Png));
            let refused = refused.expect_err("is too large");
            let size = format!("{width}x{height}");
            assert!(refused.contains(&size), "{refused}");
            assert!(refused.contains(&BACKDROP_SIDE.to_string()), "{refused}");
        }
    }
}
