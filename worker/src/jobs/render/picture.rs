//! One picture of a plan, drawn.

use super::layers::rgb8;
use super::models::Models;
use super::surroundings::{Background, Shadow};
use crate::jobs::{JobContext, JobFailure};
use std::time::{Duration, Instant};
use yoto_avatar::render::{RenderError, Rendered};
use yoto_avatar::tradeoff::sweep::fidelity;
use yoto_film::{Plan, View};
use yoto_media::png::Pixels;
use yoto_proto::v1::RenderSpec;

/// Draws the pictures of a plan.
pub(super) struct PictureRenderer<'a> {
    pub(super) context: &'a JobContext,
    pub(super) spec: &'a RenderSpec,
    pub(super) plan: &'a Plan,
    models: &'a Models<'a>,
    background: Option<Background<'a>>,
}

/// A drawn picture.
pub(super) struct Picture {
    pub(super) pixels: Vec<u8>,
    pub(super) time: Duration,
    /// dB, if there is ground truth.
    pub(super) psnr: Option<f64>,
}

impl<'a> PictureRenderer<'a> {
    /// Draws the pictures of `plan` by `models`.
    pub(super) fn new(
        context: &'a JobContext,
        spec: &'a RenderSpec,
        plan: &'a Plan,
        models: &'a Models<'a>,
    ) -> Self {
        let surroundings = plan.surroundings.as_ref();
        Self {
            context,
            spec,
            plan,
            models,
            background: surroundings.map(|it| Background::new(it, spec.transparent)),
        }
    }

    /// The channels of the pictures.
    pub(super) fn kind(&self) -> Pixels {
        match self.spec.transparent {
            true => Pixels::Rgba,
            false => Pixels::Rgb,
        }
    }

    /// Width and height of the picture of `view`, with the filmed one beside it if they are compared.
    pub(super) fn size(&self, view: &View) -> (u32, u32) {
        let pictures = if self.spec.compare { 2 } else { 1 };
        (view.camera.width * pictures, view.camera.height)
    }

    /// Draws the view with the `index`.
    pub(super) fn draw(&self, index: usize) -> Result<Picture, JobFailure> {
        let view = &self.plan.views[index];
        let compare = self.spec.compare;
        let size = (view.camera.width, view.camera.height);
        let truth = self.plan.truth.as_ref();
        let filmed = truth.and_then(|truth| truth.picture(index, size));
        if compare && filmed.is_none() {
            return Err(not_filmed(index));
        }
        let began = Instant::now();
        let mut frame = self.frame(view, index)?;
        if let Some(background) = &self.background {
            let shadow = self.shadow(view, index)?;
            background.put_behind(&mut frame, shadow.as_ref(), &view.camera);
        }
        let mut pixels = match self.kind() {
            Pixels::Rgba => frame.to_rgba8(),
            Pixels::Rgb => rgb8(&self.plan.layer, &frame),
        };
        let time = began.elapsed();
        let mut psnr = None;
        if let Some(filmed) = filmed {
            psnr = Some(fidelity(&filmed, &frame.to_rgb8()));
            if compare {
                pixels = side_by_side(&filmed, &pixels, view.camera.width);
            }
        }
        Ok(Picture { pixels, time, psnr })
    }

    /// The shadow of the people of `view`, if they cast one: what is seen of them from above.
    fn shadow(&self, view: &View, index: usize) -> Result<Option<Shadow>, JobFailure> {
        let Some(camera) = &view.shadow else {
            return Ok(None);
        };
        let from_above = View {
            actors: view.actors.clone(),
            camera: camera.clone(),
            background: [0.0; 3],
            shadow: None,
        };
        let frame = self.frame(&from_above, index)?;
        Ok(Some(Shadow::new(camera.clone(), &frame.alpha)))
    }

    /// The people of a view, unless the job must stop before they are finished. Errors name the `index`.
    fn frame(&self, view: &View, index: usize) -> Result<Rendered, JobFailure> {
        let context = self.context;
        let rendered = self.models.draw(view, &mut |_| context.check().is_ok());
        rendered.or_else(|error| {
            if matches!(error, RenderError::Stopped) {
                context.check()?;
            }
            let doing = format!("rendering view {index}");
            Err(JobFailure::failed("INTERNAL", &doing, &error))
        })
    }
}

/// The view with the `index` has no filmed picture to compare it with.
fn not_filmed(index: usize) -> JobFailure {
    let message = format!(
        "view {index} was not filmed: only a person's own motion over black, in their own light, with their \
         capture's camera and at most its size"
    );
    JobFailure::invalid("render", "compare", message)
}

/// `left` and `right` side by side, each of `width` pixels of 3 bytes.
fn side_by_side(left: &[u8], right: &[u8], width: u32) -> Vec<u8> {
    let row = 3 * width as usize;
    let rows = left.chunks_exact(row).zip(right.chunks_exact(row));
    rows.flat_map(|(left, right)| [left, right].concat())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_stand_side_by_side() {
        let (left, right) = ([1, 2, 3, 4, 5, 6], [7, 8, 9, 10, 11, 12]);
        assert_eq!(
            side_by_side(&left, &right, 1),
            [1, 2, 3, 7, 8, 9, 4, 5, 6, 10, 11, 12]
        );
    }
}
