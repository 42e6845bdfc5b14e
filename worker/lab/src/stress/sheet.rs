//! All poses of a person on one picture: truth above render.

use anyhow::Context;
use image::{GenericImage, RgbImage};
use std::path::Path;

/// Poses per row.
const COLUMNS: u32 = 8;

/// A pose's truth, if it is known, and render, of one size.
pub(super) type Cell = Vec<RgbImage>;

/// Writes the picture `path` of `cells`, row by row.
pub(super) fn write(path: &Path, cells: &[Cell]) -> anyhow::Result<()> {
    let Some((first, high)) = cells
        .first()
        .and_then(|cell| Some((cell.first()?, cell.len() as u32)))
    else {
        return Ok(());
    };
    let (width, height) = first.dimensions();
    let rows = (cells.len() as u32).div_ceil(COLUMNS);
    let mut sheet = RgbImage::new(COLUMNS * width, high * rows * height);
    for (index, cell) in (0..).zip(cells) {
        let (x, y) = (index % COLUMNS * width, index / COLUMNS * high * height);
        for (row, picture) in (0..).zip(cell) {
            sheet
                .copy_from(picture, x, y + row * height)
                .context("composing the sheet")?;
        }
    }
    sheet
        .save(path)
        .with_context(|| format!("writing {}", path.display()))
}
