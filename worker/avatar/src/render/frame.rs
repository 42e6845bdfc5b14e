//! Rendering of whole frames: a person in a pose, from a camera.

use super::enlarge::enlarge;
use super::march::{Volume, march};
use super::occupancy::Occupancy;
use super::samples::SampleCounts;
use super::settings::RenderSettings;
use crate::avatar::{Avatar, Posed};
use crate::config::{ModelConfig, Numerics, Precision};
use crate::motion::body::Body;
use crate::ops::composite::{RayAccumulator, opacity};
use crate::ops::mlp::check_device;
use burn::tensor::{Device, ExecutionError, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use thiserror::Error;
use yoto_capture::body_box::{BodyView, Ray};
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::{Skeleton, SkeletonError};

/// Rays per batch, which bounds the memory of frames of any size.
const RAYS_PER_BATCH: usize = 8192;

/// Live samples per ray in the first wave; each further wave has twice as many.
const FIRST_WAVE: usize = 8;

/// Rendering error.
#[derive(Debug, Error)]
pub enum RenderError {
    /// The model has no identity in the slot.
    #[error("the model has no identity in slot {0}")]
    NoSuchSlot(usize),
    /// The pose does not fit the identity's skeleton.
    #[error("pose: {0}")]
    Pose(#[from] SkeletonError),
    /// A number of the view is not finite.
    #[error("{0}: not a finite number")]
    NotFinite(&'static str),
    /// Invalid settings.
    #[error("{0}")]
    Settings(String),
    /// The device failed.
    #[error("device: {0}")]
    Device(String),
    /// The caller did not want the rest of the frame.
    #[error("the frame was not finished, as asked")]
    Stopped,
}

impl From<ExecutionError> for RenderError {
    fn from(error: ExecutionError) -> Self {
        Self::Device(format!("{error:?}"))
    }
}

/// A view to render.
#[derive(Clone, Debug)]
pub struct RenderView {
    /// Slot of the identity.
    pub slot: usize,
    /// Pose of the body.
    pub pose: Pose,
    /// Camera, with the size of the frame.
    pub camera: Camera,
    /// Linear rgb in [0, 1].
    pub background: [f32; 3],
}

/// A rendered frame.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// `[H, W, 3]` in [0, 1], over the background.
    pub rgb: Vec<f32>,
    /// `[H, W]` opacity.
    pub alpha: Vec<f32>,
    /// `[H, W]` Σ T α z along the camera's axis, metres, not divided by opacity.
    pub depth: Vec<f32>,
    /// Sample counts of the rays that meet the body's box.
    pub counts: SampleCounts,
}

impl Rendered {
    /// `[H, W, 3]`, rounded to 8 bits.
    pub fn to_rgb8(&self) -> Vec<u8> {
        self.rgb
            .iter()
            .map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8)
            .collect()
    }

    /// `[H, W, 4]`, rounded to 8 bits: the colour of the person, and opacity, for a frame over a
    /// black background.
    pub fn to_rgba8(&self) -> Vec<u8> {
        let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
        let pixels = self.rgb.as_chunks::<3>().0.iter().zip(&self.alpha);
        pixels
            .flat_map(|(rgb, &alpha)| {
                // Over black, a colour is its product with opacity.
                let own = |v: f32| byte(if alpha > 0.0 { v / alpha } else { 0.0 });
                [own(rgb[0]), own(rgb[1]), own(rgb[2]), byte(alpha)]
            })
            .collect()
    }
}

/// A trained model, ready to render.
pub struct Renderer {
    pub(super) config: ModelConfig,
    pub(super) avatar: Avatar,
    /// By slot.
    bodies: Vec<Option<Body>>,
    /// Occupancy grids by slot; as many as bodies.
    occupancy: Vec<Option<Occupancy>>,
    /// Completed fraction of the run, which determines the active parts of the model.
    pub(super) progress: f64,
    settings: RenderSettings,
}

impl Renderer {
    /// A renderer with `bodies` and `occupancy` by slot. `avatar` and `bodies` are on the same
    /// device, without automatic differentiation.
    pub(crate) fn new(
        config: ModelConfig,
        avatar: Avatar,
        bodies: Vec<Option<Body>>,
        occupancy: Vec<Option<Occupancy>>,
        progress: f64,
    ) -> Self {
        Self {
            settings: RenderSettings::of(&config),
            config,
            avatar,
            bodies,
            occupancy,
            progress,
        }
    }

    /// Replaces the numerics of the model's configuration. Splats have sound ones only, and keep them.
    pub fn with_numerics(mut self, numerics: Numerics) -> Self {
        if self.config.numerics != numerics && self.config.splats.is_none() {
            self.config.numerics = numerics;
            // Zeros of the prior depend on the numerics.
            for body in self.bodies.iter_mut().flatten() {
                let device = body.log_prior.device();
                *body = Body::new(body.skeleton.clone(), &self.config, &device);
            }
        }
        self
    }

    /// Renders as at `iteration` of a run of [`Schedule::steps`], with the non-rigid bands and the
    /// corrections that are active then. By default, frames use the progress of the model's
    /// training. Models imported from HumanNeRF have all parts active by default, as in the
    /// released program.
    ///
    /// [`Schedule::steps`]: crate::config::Schedule::steps
    pub fn at_iteration(mut self, iteration: u64) -> Self {
        self.progress = iteration as f64 / self.config.schedule.steps as f64;
        self
    }

    /// Device of the model.
    pub(super) fn device(&self) -> Device {
        self.avatar.device()
    }

    /// Adds a body and returns its slot.
    pub(super) fn with_body(mut self, body: Body) -> (Self, usize) {
        let slot = self.bodies.len();
        self.bodies.push(Some(body));
        self.occupancy.push(None);
        (self, slot)
    }

    /// Replaces the settings of the model's configuration.
    ///
    /// # Errors
    /// Names the first invalid field.
    pub fn with_settings(mut self, settings: &RenderSettings) -> Result<Self, RenderError> {
        self.set(settings)?;
        Ok(self)
    }

    /// As [`Self::with_settings`], in place.
    ///
    /// # Errors
    /// Names the first invalid field; the settings stay unchanged.
    pub fn set(&mut self, settings: &RenderSettings) -> Result<(), RenderError> {
        settings.check()?;
        check_device(settings.precision, &self.device())?;
        settings.apply(&mut self.config);
        self.avatar.set_precision(settings.precision);
        self.settings = *settings;
        Ok(())
    }

    /// Precisions that this renderer's device supports.
    pub fn precisions(&self) -> Vec<Precision> {
        let device = self.device();
        let supported = |precision: &Precision| check_device(*precision, &device).is_ok();
        let all = [Precision::F32, Precision::Bf16];
        all.into_iter().filter(supported).collect()
    }

    /// Current settings.
    pub fn settings(&self) -> RenderSettings {
        self.settings
    }

    /// Configuration of the model, with the current settings.
    pub fn config(&self) -> &ModelConfig {
        &self.config
    }

    /// Number of rays of a view that meet the body's box, which determines the time of a frame.
    /// They are counted at the size of the view, whatever the scale it is rendered at.
    ///
    /// # Errors
    /// As [`Self::render`].
    pub fn rays(&self, view: &RenderView) -> Result<usize, RenderError> {
        let body = self.body(view)?;
        let sight = BodyView::new(&body.skeleton, &view.pose, &view.camera);
        let (width, height) = (view.camera.width as usize, view.camera.height as usize);
        Ok((0..width * height)
            .filter(|i| {
                sight
                    .ray((i % width) as f64 + 0.5, (i / width) as f64 + 0.5)
                    .is_some()
            })
            .count())
    }

    /// The skeleton of the identity in `slot`.
    pub fn skeleton(&self, slot: usize) -> Option<&Skeleton> {
        self.bodies.get(slot)?.as_ref().map(|body| &body.skeleton)
    }

    /// Renders one view.
    ///
    /// # Errors
    /// If the slot is empty, or the pose or camera is invalid.
    pub fn render(&self, view: &RenderView) -> Result<Rendered, RenderError> {
        self.render_while(view, &mut |_| true)
    }

    /// As [`Self::render`], as long as `go_on` says so, which is told the finished share of the frame
    /// before each batch of rays: a large frame takes minutes.
    ///
    /// # Errors
    /// As [`Self::render`], and [`RenderError::Stopped`].
    pub fn render_while(
        &self,
        view: &RenderView,
        go_on: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Rendered, RenderError> {
        let body = self.body(view)?;
        let (width, height) = (view.camera.width, view.camera.height);
        let (small_width, small_height) = self.settings.rendered_size(width, height);
        if (small_width, small_height) == (width, height) {
            return self.render_whole(body, view, go_on);
        }
        let small = RenderView {
            camera: view.camera.resized(small_width, small_height),
            ..view.clone()
        };
        let frame = self.render_whole(body, &small, go_on)?;
        enlarge(&frame, width as usize, height as usize)
    }

    /// The body in `slot`, once `pose` is a pose of it.
    pub(super) fn body_in(&self, slot: usize, pose: &Pose) -> Result<&Body, RenderError> {
        let body = self.bodies.get(slot).and_then(Option::as_ref);
        let body = body.ok_or(RenderError::NoSuchSlot(slot))?;
        body.skeleton.check_pose(pose)?;
        Ok(body)
    }

    /// The body that a view shows, once the view is checked.
    fn body(&self, view: &RenderView) -> Result<&Body, RenderError> {
        let body = self.body_in(view.slot, &view.pose)?;
        if !view
            .camera
            .k
            .iter()
            .flatten()
            .chain(view.camera.e.iter().flatten())
            .all(|v| v.is_finite())
        {
            return Err(RenderError::NotFinite("camera"));
        }
        Ok(body)
    }

    /// Renders a view with one ray per pixel.
    fn render_whole(
        &self,
        body: &Body,
        view: &RenderView,
        go_on: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Rendered, RenderError> {
        if self.config.numerics == Numerics::Reference {
            return self.render_as_released(body, view, go_on);
        }
        if let Some(frame) = self.render_splats(body, view)? {
            return Ok(frame);
        }
        let posed = self
            .avatar
            .pose(&self.config, body, view.slot, &view.pose, self.progress);
        let weights = read(posed.weights.clone())?;
        let transforms = read(posed.transforms.clone())?;
        let sight = BodyView::new(&body.skeleton, &view.pose, &view.camera);
        let (width, height) = (view.camera.width as usize, view.camera.height as usize);
        let pixel = |i: usize| sight.ray((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
        let mut frame = Rendered {
            width,
            height,
            rgb: view.background.repeat(width * height),
            alpha: vec![0.0; width * height],
            depth: vec![0.0; width * height],
            counts: SampleCounts::default(),
        };
        let volume = Volume {
            weights: &weights,
            transforms: &transforms,
            grid: &body.grid,
            unposing: self.config.motion.unposing,
            occupancy: self.occupancy[view.slot].as_ref(),
            step: None,
        };
        let hits: Vec<(usize, Ray)> = (0..width * height)
            .filter_map(|i| Some((i, pixel(i)?)))
            .collect();
        for (place, batch) in hits.chunks(RAYS_PER_BATCH).enumerate() {
            if !go_on((place * RAYS_PER_BATCH) as f64 / hits.len() as f64) {
                return Err(RenderError::Stopped);
            }
            self.render_batch(body, &posed, &volume, batch, view.background, &mut frame)?;
        }
        Ok(frame)
    }

    /// Renders a batch of rays front to back in waves, so that samples behind opaque ones are not
    /// evaluated.
    fn render_batch(
        &self,
        body: &Body,
        posed: &Posed,
        volume: &Volume,
        batch: &[(usize, Ray)],
        background: [f32; 3],
        frame: &mut Rendered,
    ) -> Result<(), RenderError> {
        let rays: Vec<Option<Ray>> = batch.iter().map(|(_, ray)| Some(*ray)).collect();
        let settings = &self.config.march;
        let candidates = march(&rays, settings, None::<&mut ChaCha8Rng>, volume);
        let mut walk = candidates.walk();
        let mut sums = vec![RayAccumulator::START; rays.len()];
        let mut counts = candidates.counts();
        let mut wave = match settings.min_transmittance > 0.0 {
            true => FIRST_WAVE,
            false => usize::MAX,
        };
        let device = body.log_prior.device();
        while !walk.is_over() {
            let samples = walk.wave(wave);
            let count = samples.live();
            counts.evaluated += count as u64;
            if count == 0 {
                continue;
            }
            let points = TensorData::new(samples.canonical.clone(), [count, 3]);
            let points = Tensor::<2>::from_data(points, &device);
            let values = self.avatar.fields(&self.config, body, posed, points);
            let (rgb, density) = (read(values.rgb)?, read(values.density)?);
            if (rgb.len(), density.len()) != (3 * count, count) {
                return Err(RenderError::Device("fewer field values than points".into()));
            }
            for (i, (rgb, density)) in rgb.as_chunks::<3>().0.iter().zip(density).enumerate() {
                let sums = &mut sums[samples.ray(i)];
                if sums.transmittance >= settings.min_transmittance {
                    let alpha = opacity(density, samples.steps[i], samples.likelihoods[i]);
                    sums.add(rgb, alpha, samples.depths[i]);
                }
            }
            walk.keep(|ray| sums[ray].transmittance >= settings.min_transmittance);
            wave = wave.saturating_mul(2);
        }
        for (sums, (pixel, _)) in sums.iter().zip(batch) {
            for (c, background) in background.iter().enumerate() {
                frame.rgb[3 * pixel + c] = sums.rgb[c] + (1.0 - sums.alpha) * background;
            }
            frame.alpha[*pixel] = sums.alpha;
            frame.depth[*pixel] = sums.depth;
        }
        frame.counts += counts;
        Ok(())
    }
}

/// Values of a tensor, in host memory.
pub(crate) fn read<const D: usize>(tensor: Tensor<D>) -> Result<Vec<f32>, RenderError> {
    tensor
        .try_into_vec_as::<f32>()
        .map_err(|error| RenderError::Device(format!("{error:?}")))
}

#[cfg(test)]
#[path = "frame/tests.rs"]
mod tests;
