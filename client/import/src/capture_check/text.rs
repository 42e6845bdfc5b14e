//! Letters on a picture: an 8x8 bitmap font, so that no font file is needed.

use super::canvas::{Colour, fill};
use font8x8::{BASIC_FONTS, LATIN_FONTS, UnicodeFonts};
use image::RgbImage;

/// Pixels of a letter's side at scale 1.
pub(crate) const LETTER: u32 = 8;

/// Writes one line with its top left corner at `x`, `y`; `scale` pixels per dot.
pub(crate) fn write(
    picture: &mut RgbImage,
    x: u32,
    y: u32,
    scale: u32,
    colour: Colour,
    text: &str,
) {
    for (column, letter) in (0..).zip(text.chars()) {
        let glyph = BASIC_FONTS
            .get(letter)
            .or_else(|| LATIN_FONTS.get(letter))
            .or_else(|| BASIC_FONTS.get('?'))
            .unwrap_or_default();
        for (row, bits) in (0..).zip(glyph) {
            for bit in (0..LETTER).filter(|bit| bits >> bit & 1 == 1) {
                let left = x + (column * LETTER + bit) * scale;
                fill(picture, left, y + row * scale, [scale; 2], colour);
            }
        }
    }
}

/// `text` in lines of at most `columns` letters, broken at spaces where there are any.
pub(super) fn wrapped(text: &str, columns: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let room = lines.last().map_or(0, |line| line.chars().count());
        if room > 0 && room + 1 + word.chars().count() > columns {
            lines.push(String::new());
        }
        if let Some(line) = lines.last_mut() {
            if !line.is_empty() {
                line.push(' ');
            }
            line.push_str(word);
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_wraps_at_spaces_and_leaves_ink() {
        assert_eq!(wrapped("one two three", 7), ["one two", "three"]);
        assert_eq!(wrapped("unbreakable", 4), ["unbreakable"]);
        let mut picture = RgbImage::new(40, 10);
        write(&mut picture, 0, 0, 1, image::Rgb([255; 3]), "a°€");
        for column in 0..3 {
            let ink = (0..8).any(|x| (0..8).any(|y| picture.get_pixel(8 * column + x, y)[0] > 0));
            assert!(ink, "letter {column}");
        }
    }
}
