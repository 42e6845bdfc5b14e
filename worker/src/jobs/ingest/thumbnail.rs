//! A small picture of a capture, by which people recognise it.

use image::imageops::thumbnail;
use image::{ImageFormat, Rgb, RgbImage};
use std::io::Cursor;
use yoto_capture::Shard;

/// Longest side, pixels.
const SIDE: u32 = 256;
/// Grey behind the person: light enough for dark clothes, and dark enough for white ones.
const BEHIND: u16 = 0xc0;

/// The person in the middle frame over grey, as PNG. `None` if no person is in the frame.
///
/// # Errors
/// When the encoder fails.
pub(super) fn of(shard: &Shard) -> Result<Option<Vec<u8>>, image::ImageError> {
    if shard.frames() == 0 {
        return Ok(None);
    }
    let (rect, rgb, mask) = shard.crop(shard.frames() / 2);
    let (width, height) = (rect.width, rect.height);
    if width == 0 || height == 0 {
        return Ok(None);
    }
    let pixels = rgb.chunks_exact(3).zip(mask);
    let over_grey = pixels.flat_map(|(rgb, &mask)| {
        let behind = BEHIND * (255 - u16::from(mask)) / 255;
        // The colours are premultiplied.
        let add = |channel: u8| (u16::from(channel) + behind).min(255) as u8;
        [add(rgb[0]), add(rgb[1]), add(rgb[2])]
    });
    let picture = RgbImage::from_raw(width, height, over_grey.collect());
    let picture = picture.unwrap_or_else(|| RgbImage::from_pixel(1, 1, Rgb([BEHIND as u8; 3])));
    let scale = (f64::from(SIDE) / f64::from(width.max(height))).min(1.0);
    let scaled = |side: u32| ((f64::from(side) * scale).round() as u32).max(1);
    let small = thumbnail(&picture, scaled(width), scaled(height));
    let mut png = Cursor::new(Vec::new());
    small.write_to(&mut png, ImageFormat::Png)?;
    Ok(Some(png.into_inner()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_capture::ShardBuilder;
    use yoto_synthetic::SyntheticPerson;

    #[test]
    fn a_thumbnail_shows_the_person_of_the_middle_frame_over_grey() {
        let (track, images) = SyntheticPerson::cast(1, 7)[0].capture(3, 400);
        let mut builder = ShardBuilder::new(track);
        for image in &images {
            builder.push(image).expect("fits");
        }
        let shard = builder.finish().expect("complete");
        let png = of(&shard).expect("encodes").expect("a person");
        let small = image::load_from_memory_with_format(&png, ImageFormat::Png);
        let small = small.expect("is PNG").to_rgb8();
        let (rect, _, _) = shard.crop(1);
        assert_eq!(
            small.height().max(small.width()),
            rect.height.max(rect.width).min(SIDE)
        );
        let ratio = |width: u32, height: u32| f64::from(width) / f64::from(height);
        let change = ratio(small.width(), small.height()) / ratio(rect.width, rect.height);
        assert!((change - 1.0).abs() < 0.03, "{change}");
        let grey = small
            .pixels()
            .filter(|it| it.0 == [BEHIND as u8; 3])
            .count();
        let all = (small.width() * small.height()) as usize;
        assert!(grey > all / 20 && grey < all, "{grey} of {all}");
    }
}
