//! The people of a clip with their numbers.

use crate::capture_check::{LETTER, line, write};
use image::imageops::{FilterType, overlay, resize};
use image::{Rgb, RgbImage};
use yoto_landmarks::BodySquare;

const COLOUR: Rgb<u8> = Rgb([255, 220, 0]);
/// Height of a tile, pixels.
const HEIGHT: u32 = 360;
/// Pixels of a line and of each dot of a number, of a tile.
const DOT: u32 = 2;

/// The frame `rgb` of `size` (width, height), made smaller, with a square around `figure` and its number.
pub(super) fn tile(rgb: &[u8], size: [u32; 2], figure: &BodySquare, number: usize) -> RgbImage {
    let picture = RgbImage::from_raw(size[0], size[1], rgb.to_vec());
    let picture = picture.unwrap_or_else(|| RgbImage::new(size[0], size[1]));
    let scale = f64::from(HEIGHT) / f64::from(size[1].max(1));
    let width = ((f64::from(size[0]) * scale) as u32).max(1);
    let mut tile = resize(&picture, width, HEIGHT, FilterType::Triangle);
    let half = scale * f64::from(figure.side / BodySquare::MARGIN / 2.0);
    let [x, y] = figure.hips.map(|it| scale * f64::from(it));
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let corners = corners.map(|(across, down)| [x + across * half, y + down * half]);
    for (from, to) in corners.iter().zip(corners.iter().cycle().skip(1)) {
        line(&mut tile, *from, *to, f64::from(DOT), COLOUR);
    }
    let letters = number.to_string();
    let scale = 2 * DOT;
    let most = |side: u32, letters: u32| side.saturating_sub(letters * LETTER * scale);
    let [left, top] = corners[0].map(|it| it.max(0.0) as u32 + 2 * DOT);
    let (left, top) = (
        left.min(most(width, letters.len() as u32)),
        top.min(most(HEIGHT, 1)),
    );
    write(&mut tile, left, top, scale, COLOUR, &letters);
    tile
}

/// Tiles of one height side by side.
pub(super) fn beside(tiles: impl Iterator<Item = RgbImage>) -> RgbImage {
    let tiles: Vec<RgbImage> = tiles.collect();
    let mut sheet = RgbImage::new(tiles.iter().map(RgbImage::width).sum(), HEIGHT);
    let mut left = 0;
    for tile in &tiles {
        overlay(&mut sheet, tile, left, 0);
        left += i64::from(tile.width());
    }
    sheet
}
