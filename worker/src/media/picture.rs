//! One picture as PNG.

use super::{MediaError, Pixels, check_size};

/// Encodes `pixels` (row by row) as an 8-bit PNG.
///
/// # Errors
/// When the pixels don't fit the size.
pub fn png(kind: Pixels, width: u32, height: u32, pixels: &[u8]) -> Result<Vec<u8>, MediaError> {
    check_size(kind, width, height, pixels)?;
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(kind.colour());
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels)?;
    writer.finish()?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_survive() {
        for (kind, channels) in [(Pixels::Rgb, 3), (Pixels::Rgba, 4)] {
            let pixels: Vec<u8> = (0..5 * 3 * channels).collect();
            let bytes = png(kind, 5, 3, &pixels).expect("encodes");
            let decoded = image::load_from_memory(&bytes).expect("decodes");
            assert_eq!((decoded.width(), decoded.height()), (5, 3));
            assert_eq!(decoded.into_bytes(), pixels);
        }
    }

    #[test]
    fn too_few_pixels_are_refused() {
        assert!(matches!(
            png(Pixels::Rgb, 5, 3, &[0; 44]),
            Err(MediaError::Size { expected: 45, .. })
        ));
    }
}
