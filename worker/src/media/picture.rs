//! One picture as PNG.

use super::{MediaError, check_size};

/// Encodes `rgb` (`height * width * 3`, row by row) as an 8-bit PNG.
///
/// # Errors
/// When the pixels don't fit the size.
pub fn png(width: u32, height: u32, rgb: &[u8]) -> Result<Vec<u8>, MediaError> {
    check_size(width, height, rgb)?;
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(rgb)?;
    writer.finish()?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_survive() {
        let rgb: Vec<u8> = (0..5 * 3 * 3).collect();
        let bytes = png(5, 3, &rgb).expect("encodes");
        let decoded = image::load_from_memory(&bytes)
            .expect("decodes")
            .into_rgb8();
        assert_eq!((decoded.dimensions(), decoded.into_raw()), ((5, 3), rgb));
    }

    #[test]
    fn too_few_pixels_are_refused() {
        assert!(matches!(
            png(5, 3, &[0; 44]),
            Err(MediaError::Size { expected: 45, .. })
        ));
    }
}
