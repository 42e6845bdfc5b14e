//! Rendering held-out views and comparing them with what was really seen.

use super::captures::{Recording, Split, View};
use crate::pictures;
use crate::report::{Mean, PictureScore, Score, compare};
use anyhow::Context;
use image::{GenericImage, RgbImage};
use std::path::Path;
use std::time::Instant;
use yoto_avatar::render::{RenderView, Renderer};

/// A model as it stands, and what it is measured on.
pub(super) struct Examiner<'a> {
    renderer: Renderer,
    recordings: &'a [Recording],
}

impl<'a> Examiner<'a> {
    pub(super) fn new(renderer: Renderer, recordings: &'a [Recording]) -> Self {
        Self {
            renderer,
            recordings,
        }
    }

    /// The mean over the fixed subset of each capture.
    pub(super) fn subset(&self, split: Split) -> anyhow::Result<Score> {
        let mut mean = Mean::default();
        for (slot, recording) in self.recordings.iter().enumerate() {
            for view in recording.subset(split) {
                let (score, _, _) = self.examine(slot, view)?;
                mean.add(&score);
            }
        }
        Ok(mean.score())
    }

    /// The mean over all of one person's views; `on_picture` hears the seconds each took to
    /// render.
    pub(super) fn all(
        &self,
        slot: usize,
        split: Split,
        pictures: Option<&Path>,
        mut on_picture: impl FnMut(f64),
    ) -> anyhow::Result<Score> {
        let mut mean = Mean::default();
        let recording = self
            .recordings
            .get(slot)
            .context("a slot without a recording")?;
        for view in recording.split(split) {
            let (score, pair, seconds) = self.examine(slot, view)?;
            mean.add(&score);
            if let Some(folder) = pictures {
                let path = folder
                    .join(&recording.name)
                    .join(split.folder())
                    .join(&view.label);
                pictures::write(&path.with_extension("png"), &pair)?;
            }
            on_picture(seconds);
        }
        Ok(mean.score())
    }

    /// Score, truth beside render, and seconds of rendering.
    fn examine(&self, slot: usize, view: &View) -> anyhow::Result<(PictureScore, RgbImage, f64)> {
        let started = Instant::now();
        let request = RenderView {
            slot,
            pose: view.pose.clone(),
            camera: view.camera.clone(),
            background: [0.0; 3],
        };
        let rendered = self
            .renderer
            .render(&request)
            .with_context(|| format!("rendering {}", view.label))?;
        let seconds = started.elapsed().as_secs_f64();
        let render = pictures::rgb(
            &view.label,
            rendered.width,
            rendered.height,
            &rendered.to_rgb8(),
        )?;
        let truth = pictures::rgb(
            &view.label,
            view.truth.width,
            view.truth.height,
            &view.truth.rgb,
        )?;
        let score = compare(&view.label, &truth, &view.truth.mask, &render)?;
        Ok((score, side_by_side(&truth, &render), seconds))
    }
}

/// Two pictures of one size.
fn side_by_side(left: &RgbImage, right: &RgbImage) -> RgbImage {
    let (width, height) = left.dimensions();
    let mut pair = RgbImage::new(2 * width, height);
    for (picture, x) in [(left, 0), (right, width)] {
        let placed = pair.copy_from(picture, x, 0);
        debug_assert!(
            placed.is_ok(),
            "both pictures were compared, so both have one size"
        );
    }
    pair
}
