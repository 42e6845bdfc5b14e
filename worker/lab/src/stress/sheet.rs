//! All poses of a person on one picture: truth above render.

use anyhow::Context;
use image::{GenericImage, RgbImage};
use std::path::Path;

/// Poses per row.
const COLUMNS: u32 = 8;

/// A pose's truth and render, of one size.
pub(super) type Cell = [RgbImage; 2];

/// Writes the picture `path` of `cells`, row by row.
pub(super) fn write(path: &Path, cells: &[Cell]) -> anyhow::Result<()> {
    let Some([first, _]) = cells.first() else {
        return Ok(());
    };
    let (width, height) = first.dimensions();
    let rows = (cells.len() as u32).div_ceil(COLUMNS);
    let mut sheet = RgbImage::new(COLUMNS * width, 2 * rows * height);
    for (index, cell) in (0..).zip(cells) {
        let (x, y) = (index % COLUMNS * width, index / COLUMNS * 2 * height);
        for (picture, y) in cell.iter().zip([y, y + height]) {
            sheet
                .copy_from(picture, x, y)
                .context("composing the sheet")?;
        }
    }
    sheet
        .save(path)
        .with_context(|| format!("writing {}", path.display()))
}
