//! Single pictures: PNG, JPEG, WebP.

use crate::{Limits, MEMORY_LIMIT, MediaFault, Picture, sniff};
use image::error::LimitErrorKind;
use image::{DynamicImage, ImageDecoder, ImageError, ImageReader, Limits as DecoderLimits};
use std::io::Cursor;

/// Bytes that a decoder may allocate besides the pixels.
const DECODER_SLACK: u64 = 16 << 20;

/// Decodes `bytes`, rotated by their EXIF orientation.
///
/// Width and height are read first and compared with the limits, so that a small file can't
/// ask for gigabytes.
///
/// # Errors
/// When the bytes are not a picture, are cut short, or declare too many pixels.
pub fn decode_still(bytes: &[u8], limits: &Limits) -> Result<Picture, MediaFault> {
    let mut decoder = open(bytes, limits)?;
    let (width, height) = decoder.dimensions();
    let mut allowed = DecoderLimits::no_limits();
    allowed.max_alloc = Some(u64::from(width) * u64::from(height) * 16 + DECODER_SLACK);
    decoder.set_limits(allowed).map_err(undecodable)?;
    let orientation = decoder.orientation().map_err(undecodable)?;
    let lossy = !matches!(sniff::kind(bytes), sniff::FileType::Png);
    let mut image = DynamicImage::from_decoder(decoder).map_err(undecodable)?;
    image.apply_orientation(orientation);
    Ok(picture(image, lossy))
}

/// Width and height in the file's header, after rotation, without decoding it.
///
/// # Errors
/// The same errors as [`decode_still`].
pub fn still_size(bytes: &[u8], limits: &Limits) -> Result<[u32; 2], MediaFault> {
    let mut decoder = open(bytes, limits)?;
    let (width, height) = decoder.dimensions();
    // EXIF orientations 5 to 8 exchange width and height.
    let transposed = decoder
        .orientation()
        .is_ok_and(|orientation| orientation.to_exif() >= 5);
    Ok(if transposed {
        [height, width]
    } else {
        [width, height]
    })
}

fn undecodable(error: ImageError) -> MediaFault {
    match &error {
        ImageError::Limits(limit) if limit.kind() == LimitErrorKind::InsufficientMemory => {
            MediaFault::new(MEMORY_LIMIT, "there is not enough memory to decode it")
        }
        _ => MediaFault::undecodable(format!("can't be decoded: {error}")),
    }
}

fn open<'a>(bytes: &'a [u8], limits: &Limits) -> Result<impl ImageDecoder + 'a, MediaFault> {
    if bytes.is_empty() {
        return Err(MediaFault::new("EMPTY", "the file has no bytes"));
    }
    let kind = sniff::kind(bytes);
    if !kind.is_still() {
        let message = format!("is {}; PNG, JPEG and WebP pictures are read", kind.name());
        return Err(MediaFault::undecodable(message));
    }
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|error| undecodable(error.into()))?;
    // The size is checked below, with a better message.
    reader.no_limits();
    let decoder = reader.into_decoder().map_err(undecodable)?;
    let (width, height) = decoder.dimensions();
    if width == 0 || height == 0 || width > limits.side || height > limits.side {
        let message = format!(
            "declares {width}x{height} pixels; each side must be 1 to {}",
            limits.side
        );
        return Err(MediaFault::new("TOO_LARGE", message));
    }
    Ok(decoder)
}

fn picture(image: DynamicImage, lossy: bool) -> Picture {
    let (width, height) = (image.width() as usize, image.height() as usize);
    let (rgb, alpha) = if image.color().has_alpha() {
        let rgba = image.into_rgba8().into_raw();
        let alpha = rgba.iter().skip(3).step_by(4).copied().collect();
        let rgb = rgba
            .chunks_exact(4)
            .flat_map(|p| [p[0], p[1], p[2]])
            .collect();
        (rgb, Some(alpha))
    } else {
        (image.into_rgb8().into_raw(), None)
    };
    Picture {
        width,
        height,
        rgb,
        alpha,
        lossy,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{ImageFormat, RgbImage, RgbaImage};

    fn encode(image: impl Into<DynamicImage>, format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        image.into().write_to(&mut bytes, format).expect("encodes");
        bytes.into_inner()
    }

    #[test]
    fn png_jpeg_and_webp_are_read_with_their_alpha() {
        let limits = Limits::default();
        let rgb = RgbImage::from_fn(7, 5, |x, y| image::Rgb([x as u8 * 30, y as u8 * 40, 90]));
        let png = decode_still(&encode(rgb.clone(), ImageFormat::Png), &limits).expect("decodes");
        assert_eq!(
            (png.width, png.height, png.alpha, png.lossy),
            (7, 5, None, false)
        );
        assert_eq!(png.rgb, rgb.clone().into_raw());
        let jpeg = decode_still(&encode(rgb, ImageFormat::Jpeg), &limits).expect("decodes");
        assert!(jpeg.lossy && jpeg.rgb.len() == 7 * 5 * 3);
        let rgba = RgbaImage::from_fn(3, 2, |x, _| image::Rgba([10, 20, 30, x as u8 * 100]));
        for format in [ImageFormat::Png, ImageFormat::WebP] {
            let picture = decode_still(&encode(rgba.clone(), format), &limits).expect("decodes");
            assert_eq!(
                picture.alpha,
                Some(vec![0, 100, 200, 0, 100, 200]),
                "{format:?}"
            );
        }
    }

    #[test]
    fn bombs_cuts_and_lies_are_named() {
        let limits = Limits {
            side: 6,
            ..Limits::default()
        };
        let code = |bytes: &[u8]| decode_still(bytes, &limits).expect_err("refused").code;
        let good = encode(RgbImage::new(6, 6), ImageFormat::Png);
        assert!(decode_still(&good, &limits).is_ok());
        assert_eq!(
            code(&encode(RgbImage::new(7, 1), ImageFormat::Png)),
            "TOO_LARGE"
        );
        assert_eq!(code(&[]), "EMPTY");
        assert_eq!(code(b"\0\0\0\x20ftypisom...."), "UNDECODABLE");
        for length in 1..good.len() - 12 {
            assert_eq!(code(&good[..length]), "UNDECODABLE", "{length} bytes");
        }
    }

    #[test]
    fn sixty_thousand_pixels_a_side_are_refused_by_the_header_alone() {
        let mut bomb = encode(RgbImage::new(1, 1), ImageFormat::Png);
        // IHDR: width and height at 16..24, then its checksum at 29..33.
        bomb[16..20].copy_from_slice(&60_000u32.to_be_bytes());
        bomb[20..24].copy_from_slice(&60_000u32.to_be_bytes());
        let sum = crc(&bomb[12..29]);
        bomb[29..33].copy_from_slice(&sum.to_be_bytes());
        let fault = decode_still(&bomb, &Limits::default()).expect_err("refused");
        assert!(fault.message.contains("60000x60000"), "{fault}");
        assert_eq!(fault.code, "TOO_LARGE");
    }

    fn crc(bytes: &[u8]) -> u32 {
        let mut crc = flate2::Crc::new();
        crc.update(bytes);
        crc.sum()
    }
}
