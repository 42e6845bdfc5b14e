//! Frames of models that consist of splats.

use super::frame::{RenderError, RenderView, Rendered, Renderer, read};
use super::samples::SampleCounts;
use crate::motion::body::Body;
use crate::ops::splat::{Sight, Splats, cpu::Numbers, draw};
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;

/// `camera` in the frame of a body in `pose`.
pub(crate) fn sight(skeleton: &Skeleton, pose: &Pose, camera: &Camera) -> Sight {
    let to_world = skeleton.body_to_world(pose);
    let inside = camera.in_frame(&to_world);
    let row = |row: &[f64]| -> [f32; 3] { std::array::from_fn(|c| row[c] as f32) };
    Sight {
        width: camera.width as usize,
        height: camera.height as usize,
        k: [row(&inside.k[0]), row(&inside.k[1])],
        e: std::array::from_fn(|r| inside.e[r].map(|v| v as f32)),
        world: std::array::from_fn(|r| row(&to_world[r])),
    }
}

/// [`Splats`] in host memory.
pub(crate) struct HostSplats {
    transforms: Vec<f32>,
    rows: Vec<f32>,
    light: Vec<f32>,
}

impl HostSplats {
    /// Reads `splats` from their device.
    pub fn read(splats: Splats) -> Result<Self, RenderError> {
        Ok(Self {
            rows: read(splats.rows().detach())?,
            transforms: read(splats.transforms.detach())?,
            light: read(splats.light.detach())?,
        })
    }

    /// As [`draw`] takes them.
    pub fn numbers(&self) -> Numbers<'_> {
        Numbers {
            transforms: &self.transforms,
            rows: &self.rows,
            light: &self.light,
        }
    }
}

impl Renderer {
    /// Renders a view of a model of splats; `None` if the model has a field.
    pub(super) fn render_splats(
        &self,
        body: &Body,
        view: &RenderView,
    ) -> Result<Option<Rendered>, RenderError> {
        if self.config.splats.is_none() {
            return Ok(None);
        }
        let posed = self
            .avatar
            .pose(&self.config, body, view.slot, &view.pose, self.progress);
        let Some(splats) = self.avatar.posed_splats(&self.config, body, &posed) else {
            return Ok(None);
        };
        let splats = HostSplats::read(splats)?;
        let sight = sight(&body.skeleton, &view.pose, &view.camera);
        let mut drawn = draw(&splats.numbers(), &sight);
        let pixels = drawn.rgb.as_chunks_mut::<3>().0.iter_mut();
        for (rgb, alpha) in pixels.zip(&drawn.alpha) {
            for (value, background) in rgb.iter_mut().zip(view.background) {
                *value = (*value + (1.0 - alpha) * background).clamp(0.0, 1.0);
            }
        }
        Ok(Some(Rendered {
            width: sight.width,
            height: sight.height,
            rgb: drawn.rgb,
            alpha: drawn.alpha,
            depth: drawn.depth,
            counts: SampleCounts::default(),
        }))
    }
}
