//! One picture as PNG.

use super::{Pixels, PngError, check_size};

/// Encodes `pixels` (row by row) as an 8-bit PNG, quickly: pictures of people over one colour hardly get smaller
/// with more effort.
///
/// # Errors
/// When the pixels don't fit the size.
pub fn encode(kind: Pixels, width: u32, height: u32, pixels: &[u8]) -> Result<Vec<u8>, PngError> {
    check_size(kind, width, height, pixels)?;
    let mut bytes = Vec::new();
    let mut encoder = ::png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(kind.colour());
    encoder.set_depth(::png::BitDepth::Eight);
    encoder.set_compression(::png::Compression::Fast);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels)?;
    writer.finish()?;
    Ok(bytes)
}

/// The pixels of a PNG that [`encode`] wrote, with its size.
///
/// # Errors
/// When the bytes are no picture.
pub fn decode(kind: Pixels, bytes: &[u8]) -> Result<(u32, u32, Vec<u8>), PngError> {
    let picture = image::load_from_memory_with_format(bytes, image::ImageFormat::Png)?;
    let (width, height) = (picture.width(), picture.height());
    let pixels = match kind {
        Pixels::Rgb => picture.into_rgb8().into_raw(),
        Pixels::Rgba => picture.into_rgba8().into_raw(),
    };
    Ok((width, height, pixels))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_survive() {
        for (kind, channels) in [(Pixels::Rgb, 3), (Pixels::Rgba, 4)] {
            let pixels: Vec<u8> = (0..5 * 3 * channels).collect();
            let bytes = encode(kind, 5, 3, &pixels).expect("encodes");
            let decoded = decode(kind, &bytes).expect("decodes");
            assert_eq!(decoded, (5, 3, pixels));
        }
    }

    #[test]
    fn too_few_pixels_are_refused() {
        assert!(matches!(
            encode(Pixels::Rgb, 5, 3, &[0; 44]),
            Err(PngError::Size { expected: 45, .. })
        ));
    }
}
