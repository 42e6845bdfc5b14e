//! Rendering the view of a picture, and scoring the render by a protocol.

use super::score::unit;
use super::{EvaluateError, LpipsMetric, PictureScore, Protocol, RegionSums, compare};
use crate::render::{FrameExposure, RenderError, RenderView, Renderer};
use std::time::Instant;
use yoto_capture::FrameImage;
use yoto_capture::body_box::outside;
use yoto_capture::camera::{Camera, Pose};

/// A picture that was not trained on, with its pose and camera.
#[derive(Clone, Copy, Debug)]
pub struct Truth<'a> {
    /// Pose of the person.
    pub pose: &'a Pose,
    /// Camera, with the picture's size.
    pub camera: &'a Camera,
    /// The picture, over black.
    pub image: &'a FrameImage,
    /// Exposure of the picture relative to others of the person's capture.
    pub exposure: FrameExposure,
}

/// Result of one picture.
#[derive(Clone, Debug)]
pub struct Examined {
    /// Its scores.
    pub score: PictureScore,
    /// Its error by region.
    pub regions: RegionSums,
    /// The ground truth as compared, 8-bit colours row by row.
    pub truth: Vec<u8>,
    /// The render as compared, 8-bit colours row by row.
    pub render: Vec<u8>,
    /// Seconds that rendering took.
    pub seconds: f64,
}

/// A model, and the protocol that it is measured by.
pub struct Examiner {
    renderer: Renderer,
    protocol: &'static Protocol,
    lpips: Option<LpipsMetric>,
}

impl Examiner {
    /// Measures `renderer` by `protocol`, with LPIPS if its networks are given.
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

    /// Returns the model.
    pub fn into_renderer(self) -> Renderer {
        self.renderer
    }

    /// Renders the person in `slot` in the view of `truth` and compares the two pictures, both with
    /// 8 bits per colour, as in files.
    ///
    /// # Errors
    /// If the view can't be rendered, or the picture does not have its camera's size or is too
    /// small to compare.
    pub fn examine(&self, slot: usize, truth: &Truth<'_>) -> Result<Examined, EvaluateError> {
        let started = Instant::now();
        let mut rendered = self.renderer.render(&RenderView {
            slot,
            pose: truth.pose.clone(),
            camera: truth.camera.clone(),
            background: [0.0; 3],
        })?;
        truth.exposure.expose(&mut rendered);
        let mut render = rendered.to_rgb8();
        let seconds = started.elapsed().as_secs_f64();
        let mut real = truth.image.clone();
        let size = (rendered.width, rendered.height);
        let skeleton = self.renderer.skeleton(slot);
        let skeleton = skeleton.ok_or(RenderError::NoSuchSlot(slot))?;
        if self.protocol.black_outside_box {
            let outside = outside(skeleton, truth.pose, truth.camera);
            blacken(&mut render, &outside);
            blacken(&mut real.rgb, &outside);
        }
        let mut score = compare(&real, &render, size)?;
        let regions = RegionSums::of(
            &real,
            &render,
            &rendered.alpha,
            skeleton,
            truth.pose,
            truth.camera,
        );
        if let Some(lpips) = &self.lpips {
            let (width, height) = size;
            let distance = lpips.distance(&unit(&real.rgb), &unit(&render), width, height)?;
            score.lpips = Some(distance);
        }
        Ok(Examined {
            score,
            regions,
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
