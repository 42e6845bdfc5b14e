//! Rendering what a picture shows, and scoring the render by a protocol.

use super::score::unit;
use super::{EvaluateError, LpipsMetric, PictureScore, Protocol, compare};
use crate::render::{RenderView, Renderer};
use std::time::Instant;
use yoto_capture::FrameImage;
use yoto_capture::body_box::outside;
use yoto_capture::camera::{Camera, Pose};

/// A picture that training never saw, and how it came about.
#[derive(Clone, Copy, Debug)]
pub struct Truth<'a> {
    /// How the person stands.
    pub pose: &'a Pose,
    /// What saw them, at the picture's size.
    pub camera: &'a Camera,
    /// What it saw, over black.
    pub image: &'a FrameImage,
}

/// What came of one picture.
#[derive(Clone, Debug)]
pub struct Examined {
    /// Its figures.
    pub score: PictureScore,
    /// The truth as it was compared, 8-bit colours row by row.
    pub truth: Vec<u8>,
    /// The render as it was compared.
    pub render: Vec<u8>,
    /// Seconds of rendering.
    pub seconds: f64,
}

/// A model as it stands, and the rules it is measured by.
pub struct Examiner {
    renderer: Renderer,
    protocol: &'static Protocol,
    lpips: Option<LpipsMetric>,
}

impl Examiner {
    /// Measures `renderer` by `protocol`; LPIPS only when its networks are given.
    pub fn new(
        renderer: Renderer,
        protocol: &'static Protocol,
        lpips: Option<LpipsMetric>,
    ) -> Self {
        Self {
            renderer,
            protocol,
            lpips,
        }
    }

    /// The model.
    pub fn renderer(&self) -> &Renderer {
        &self.renderer
    }

    /// The model, when there is nothing more to examine.
    pub fn into_renderer(self) -> Renderer {
        self.renderer
    }

    /// Renders the person in `slot` as `truth` shows them, and compares. Both pictures are
    /// compared with 8 bits a colour, as files hold them.
    ///
    /// # Errors
    /// When the model can't render it, or the picture is not of its camera's size or too
    /// small to compare.
    pub fn examine(&self, slot: usize, truth: &Truth<'_>) -> Result<Examined, EvaluateError> {
        let started = Instant::now();
        let rendered = self.renderer.render(&RenderView {
            slot,
            pose: truth.pose.clone(),
            camera: truth.camera.clone(),
            background: [0.0; 3],
        })?;
        let mut render = rendered.to_rgb8();
        let seconds = started.elapsed().as_secs_f64();
        let mut real = truth.image.clone();
        let size = (rendered.width, rendered.height);
        if self.protocol.black_outside_box
            && let Some(skeleton) = self.renderer.skeleton(slot)
        {
            let outside = outside(skeleton, truth.pose, truth.camera);
            blacken(&mut render, &outside);
            blacken(&mut real.rgb, &outside);
        }
        let mut score = compare(&real, &render, size)?;
        if let Some(lpips) = &self.lpips {
            let (width, height) = size;
            let distance = lpips.distance(&unit(&real.rgb), &unit(&render), width, height)?;
            score.lpips = Some(distance);
        }
        Ok(Examined {
            score,
            truth: real.rgb,
            render,
            seconds,
        })
    }
}

/// Makes the chosen pixels of an 8-bit picture black.
fn blacken(rgb: &mut [u8], chosen: &[bool]) {
    for (pixel, &chosen) in rgb.chunks_exact_mut(3).zip(chosen) {
        if chosen {
            pixel.fill(0);
        }
    }
}
