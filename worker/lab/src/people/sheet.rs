//! A sheet of everybody in a model: a held-out picture of each beside its render.

use crate::captures::{Recording, Split};
use crate::pictures;
use anyhow::Context;
use image::{GenericImage, Rgb, RgbImage};
use std::path::Path;
use yoto_avatar::render::{RenderView, Renderer};

/// People in a row.
const ACROSS: u32 = 6;
/// Between two people, pixels.
const GAP: u32 = 4;
/// Grey of the gaps.
const PAPER: Rgb<u8> = Rgb([64; 3]);

/// Writes the sheet: the truth left, the render right, six people in a row.
pub(super) fn write(
    path: &Path,
    renderer: &Renderer,
    recordings: &[Recording],
) -> anyhow::Result<()> {
    let mut pairs = Vec::new();
    for (slot, recording) in recordings.iter().enumerate() {
        let views = recording.split(Split::NovelView);
        // Each from another side than the one before.
        let place = slot * views.len() / recordings.len().max(1);
        let view = views.get(place).context("nothing is held out")?;
        let (width, height) = (view.truth.width, view.truth.height);
        let rendered = renderer.render(&RenderView {
            slot,
            pose: view.pose.clone(),
            camera: view.camera.clone(),
            background: [0.0; 3],
        })?;
        let truth = pictures::rgb(&view.label, width, height, &view.truth.rgb)?;
        let render = pictures::rgb(&view.label, width, height, &rendered.to_rgb8())?;
        pairs.push([truth, render]);
    }
    let side = |of: fn(&RgbImage) -> u32| {
        let all = pairs.iter().flatten();
        all.map(of).max().unwrap_or(0)
    };
    let (width, height) = (side(RgbImage::width), side(RgbImage::height));
    let across = ACROSS.min(pairs.len() as u32);
    let down = (pairs.len() as u32).div_ceil(ACROSS);
    let mut sheet = RgbImage::from_pixel(across * (2 * width + GAP), down * (height + GAP), PAPER);
    for (i, pair) in (0..).zip(&pairs) {
        let (left, top) = (i % ACROSS * (2 * width + GAP), i / ACROSS * (height + GAP));
        for (left, picture) in [left, left + width].into_iter().zip(pair) {
            sheet.copy_from(picture, left, top).context("a sheet")?;
        }
    }
    Ok(pictures::write(path, &sheet)?)
}
