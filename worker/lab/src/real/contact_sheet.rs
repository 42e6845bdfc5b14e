//! All clips on one picture: for each, a few held-out frames, truth beside render.

use super::Clip;
use crate::captures::Split;
use anyhow::Context;
use image::imageops::{self, FilterType};
use image::{GenericImage, RgbImage};
use std::path::{Path, PathBuf};

/// Held-out frames per clip and split.
const FRAMES: usize = 2;
/// Height of a row, pixels.
const HEIGHT: u32 = 384;
/// Largest width of one picture of a row, in heights.
const WIDEST: f64 = 1.2;
/// Value of a colour above which a pixel of the truth is not the black around the person.
const SHOWN: u8 = 16;

/// Writes `sheet.png` into the folder `out` of the clips' results.
pub(super) fn write(out: &Path, clips: &[Clip]) -> anyhow::Result<()> {
    let mut rows = Vec::new();
    for clip in clips.iter().filter(|it| it.report.is_some()) {
        let pictures = out.join(&clip.name).join("pictures").join(&clip.name);
        let mut row = Vec::new();
        for split in [Split::NovelView, Split::NovelPose] {
            for path in chosen(&pictures.join(split.folder()))? {
                row.extend(pair(&path)?);
            }
        }
        rows.push(row);
    }
    let width = |row: &Vec<RgbImage>| row.iter().map(RgbImage::width).sum::<u32>();
    let widest = rows.iter().map(width).max().unwrap_or(0);
    if widest == 0 {
        return Ok(());
    }
    let mut sheet = RgbImage::new(widest, HEIGHT * rows.len() as u32);
    for (y, row) in (0..).step_by(HEIGHT as usize).zip(&rows) {
        let mut x = 0;
        for picture in row {
            sheet
                .copy_from(picture, x, y)
                .context("composing the contact sheet")?;
            x += picture.width();
        }
    }
    let path = out.join("sheet.png");
    sheet
        .save(&path)
        .with_context(|| format!("writing {}", path.display()))
}

/// Some of the pictures in `folder`, evenly spread; none if it has none.
fn chosen(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let reading = || format!("reading {}", folder.display());
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).with_context(reading)? {
        found.push(entry.with_context(reading)?.path());
    }
    found.sort();
    let count = FRAMES.min(found.len());
    Ok((0..count)
        .map(|index| found[(2 * index + 1) * found.len() / (2 * count)].clone())
        .collect())
}

/// Truth and render of the picture `path`, which has both beside their difference, cut to the person.
fn pair(path: &Path) -> anyhow::Result<[RgbImage; 2]> {
    let all = image::open(path).with_context(|| format!("reading {}", path.display()))?;
    let all = all.to_rgb8();
    let (width, height) = (all.width() / 3, all.height());
    let mut region = [width, height, 0, 0];
    for (x, y, pixel) in all.enumerate_pixels() {
        if x < width && pixel.0.iter().any(|value| *value > SHOWN) {
            region[0] = region[0].min(x);
            region[1] = region[1].min(y);
            region[2] = region[2].max(x + 1);
            region[3] = region[3].max(y + 1);
        }
    }
    let [x0, y0, x1, y1] = region;
    if x1 <= x0 || y1 <= y0 {
        let black = RgbImage::new(HEIGHT / 2, HEIGHT);
        return Ok([black.clone(), black]);
    }
    let (wide, high) = (f64::from(x1 - x0), f64::from(y1 - y0));
    let scale = f64::from(HEIGHT) / high.max(wide / WIDEST);
    let [wide, high] = [wide, high].map(|side| ((side * scale) as u32).max(1));
    Ok([0, width].map(|offset| {
        let part = imageops::crop_imm(&all, offset + x0, y0, x1 - x0, y1 - y0).to_image();
        let part = imageops::resize(&part, wide, high.min(HEIGHT), FilterType::Triangle);
        let mut padded = RgbImage::new(wide + 8, HEIGHT);
        imageops::overlay(&mut padded, &part, 4, 0);
        padded
    }))
}
