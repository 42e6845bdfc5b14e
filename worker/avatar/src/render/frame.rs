//! Whole frames: the part of the library that answers "how does this person look in this pose
//! from there?".

use super::enlarge::enlarge;
use super::march::{SampleCounts, Volume, march};
use super::occupancy::Occupancy;
use super::rays::{BodyView, Ray};
use super::settings::RenderSettings;
use crate::avatar::{Avatar, Posed};
use crate::config::{ModelConfig, Numerics, Precision};
use crate::motion::body::Body;
use crate::ops::composite::{RayAccumulator, opacity};
use crate::ops::mlp::check_device;
use burn::tensor::{Device, ExecutionError, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use thiserror::Error;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::{Skeleton, SkeletonError};

/// Rays a batch: bounds the memory of a frame whatever its size.
const RAYS_PER_BATCH: usize = 8192;

/// Live samples of a ray that are evaluated at first; each further wave takes twice as many.
const FIRST_WAVE: usize = 8;

/// Why a frame can't be rendered.
#[derive(Debug, Error)]
pub enum RenderError {
    /// The model has nobody there.
    #[error("the model has no identity in slot {0}")]
    NoSuchSlot(usize),
    /// The pose is not of the identity's skeleton.
    #[error("pose: {0}")]
    Pose(#[from] SkeletonError),
    /// A number of the request can't be computed with.
    #[error("{0}: not a finite number")]
    NotFinite(&'static str),
    /// Settings that no frame can be rendered with.
    #[error("{0}")]
    Settings(String),
    /// The device failed.
    #[error("device: {0}")]
    Device(String),
}

impl From<ExecutionError> for RenderError {
    fn from(error: ExecutionError) -> Self {
        Self::Device(format!("{error:?}"))
    }
}

/// What to render.
#[derive(Clone, Debug)]
pub struct RenderView {
    /// Whose appearance.
    pub slot: usize,
    /// In which pose.
    pub pose: Pose,
    /// Seen from where, and how large.
    pub camera: Camera,
    /// Linear rgb in [0, 1].
    pub background: [f32; 3],
}

/// A rendered frame.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// Pixels.
    pub width: usize,
    /// Pixels.
    pub height: usize,
    /// `[H, W, 3]` in [0, 1], over the background.
    pub rgb: Vec<f32>,
    /// `[H, W]` opacity.
    pub alpha: Vec<f32>,
    /// `[H, W]` Σ T α z along the camera's axis, metres, not divided by opacity.
    pub depth: Vec<f32>,
    /// How many samples came how far, on rays that meet the body's box.
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
}

/// A trained model, ready to render.
pub struct Renderer {
    pub(crate) config: ModelConfig,
    pub(crate) avatar: Avatar,
    bodies: Vec<Option<Body>>,
    /// By slot.
    occupancy: Vec<Option<Occupancy>>,
    /// Share of the run that the model has been through: what is open of it.
    pub(super) progress: f64,
    settings: RenderSettings,
}

impl Renderer {
    /// `bodies[slot]` on the avatar's device, without automatic differentiation.
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

    /// The same model with other numerics than its own configuration names.
    pub fn with_numerics(mut self, numerics: Numerics) -> Self {
        if self.config.numerics != numerics {
            self.config.numerics = numerics;
            // The prior's zeros and the grid's floor depend on them.
            for body in self.bodies.iter_mut().flatten() {
                let device = body.log_prior.device();
                *body = Body::new(body.skeleton.clone(), &self.config, &device);
            }
        }
        self
    }

    /// Frames as at `iteration` of a run of the model's own length ([`Schedule::steps`]), which
    /// opens the non-rigid bands and the corrections. Without this call frames show what the
    /// model has been trained to; models of the released HumanNeRF program show everything open,
    /// as that program renders whatever the checkpoint's iteration.
    ///
    /// [`Schedule::steps`]: crate::config::Schedule::steps
    pub fn at_iteration(mut self, iteration: u64) -> Self {
        self.progress = iteration as f64 / self.config.schedule.steps as f64;
        self
    }

    /// Where the model is.
    pub(crate) fn device(&self) -> Device {
        self.avatar.device()
    }

    /// The model with a further body, and its slot.
    pub(crate) fn with_body(mut self, body: Body) -> (Self, usize) {
        let slot = self.bodies.len();
        self.bodies.push(Some(body));
        self.occupancy.push(None);
        (self, slot)
    }

    /// The same model, rendering with `settings` in place of its own configuration's.
    ///
    /// # Errors
    /// When no frame can be rendered with them; the field is named.
    pub fn with_settings(mut self, settings: &RenderSettings) -> Result<Self, RenderError> {
        self.set(settings)?;
        Ok(self)
    }

    /// As [`Self::with_settings`], for one who tries many.
    ///
    /// # Errors
    /// As there; the settings stay as they were.
    pub fn set(&mut self, settings: &RenderSettings) -> Result<(), RenderError> {
        settings.check()?;
        if let Some(body) = self.bodies.iter().flatten().next() {
            check_device(settings.precision, &body.log_prior.device())?;
        }
        settings.apply(&mut self.config);
        self.avatar.set_precision(settings.precision);
        self.settings = *settings;
        Ok(())
    }

    /// What the networks can multiply in on this renderer's device.
    pub fn precisions(&self) -> Vec<Precision> {
        let runs = |precision: &Precision| {
            let mut bodies = self.bodies.iter().flatten();
            bodies.all(|body| check_device(*precision, &body.log_prior.device()).is_ok())
        };
        let all = [Precision::F32, Precision::Bf16];
        all.into_iter().filter(runs).collect()
    }

    /// What frames are rendered with now.
    pub fn settings(&self) -> RenderSettings {
        self.settings
    }

    /// The model's configuration, with the present settings in it.
    pub fn config(&self) -> &ModelConfig {
        &self.config
    }

    /// Rays of a view that pass through the body's box: what a frame's time grows with. The
    /// view's own size counts, whatever scale it is rendered at.
    ///
    /// # Errors
    /// As [`Self::render`].
    pub fn rays(&self, view: &RenderView) -> Result<usize, RenderError> {
        let body = self.body(view)?;
        let sight = BodyView::new(body, &view.pose, &view.camera);
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
    /// When the slot is empty, or the pose or camera is not one.
    pub fn render(&self, view: &RenderView) -> Result<Rendered, RenderError> {
        let body = self.body(view)?;
        let (width, height) = (view.camera.width, view.camera.height);
        let (small_width, small_height) = self.settings.rendered_size(width, height);
        if (small_width, small_height) == (width, height) {
            return self.render_whole(body, view);
        }
        let small = RenderView {
            camera: view.camera.resized(small_width, small_height),
            ..view.clone()
        };
        let frame = self.render_whole(body, &small)?;
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

    /// Every pixel of the view by a ray of its own.
    fn render_whole(&self, body: &Body, view: &RenderView) -> Result<Rendered, RenderError> {
        if self.config.numerics == Numerics::Reference {
            return self.render_as_released(body, view);
        }
        let posed = self
            .avatar
            .pose(&self.config, body, view.slot, &view.pose, self.progress);
        let weights = read(posed.weights.clone())?;
        let transforms = read(posed.transforms.clone())?;
        let sight = BodyView::new(body, &view.pose, &view.camera);
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
            occupancy: self.occupancy.get(view.slot).and_then(Option::as_ref),
            step: None,
        };
        let hits: Vec<(usize, Ray)> = (0..width * height)
            .filter_map(|i| Some((i, pixel(i)?)))
            .collect();
        for batch in hits.chunks(RAYS_PER_BATCH) {
            self.render_batch(body, &posed, &volume, batch, view.background, &mut frame)?;
        }
        Ok(frame)
    }

    /// Renders some rays front to back in waves, so that what is hidden behind what is opaque
    /// is never evaluated.
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
        let samples = march(&rays, settings, None::<&mut ChaCha8Rng>, volume);
        let mut counts = SampleCounts {
            evaluated: 0,
            ..samples.counts()
        };
        let ends = &samples.starts()[1..];
        let mut next = samples.starts();
        let mut sums = vec![RayAccumulator::START; rays.len()];
        let mut active: Vec<usize> = (0..rays.len()).filter(|&r| next[r] < ends[r]).collect();
        let mut wave = match settings.min_transmittance > 0.0 {
            true => FIRST_WAVE,
            false => usize::MAX,
        };
        let device = body.log_prior.device();
        while !active.is_empty() {
            let mut points = Vec::with_capacity(3 * wave.min(samples.per_ray) * active.len());
            for &ray in &active {
                let last = ends[ray].min(next[ray].saturating_add(wave));
                points.extend_from_slice(&samples.canonical[3 * next[ray]..3 * last]);
            }
            let count = points.len() / 3;
            counts.evaluated += count as u64;
            let points = Tensor::<2>::from_data(TensorData::new(points, [count, 3]), &device);
            let values = self.avatar.fields(&self.config, body, posed, points);
            let (rgb, density) = (read(values.rgb)?, read(values.density)?);
            let mut fields = rgb.as_chunks::<3>().0.iter().zip(&density);
            for &ray in &active {
                let last = ends[ray].min(next[ray].saturating_add(wave));
                let sums = &mut sums[ray];
                // Also takes the values of the samples that turn out to be hidden.
                for (i, (rgb, density)) in (next[ray]..last).zip(fields.by_ref()) {
                    if sums.transmittance >= settings.min_transmittance {
                        let alpha = opacity(*density, samples.steps[i], samples.likelihoods[i]);
                        sums.add(rgb, alpha, samples.depths[i]);
                    }
                }
                next[ray] = last;
            }
            active.retain(|&ray| {
                next[ray] < ends[ray] && sums[ray].transmittance >= settings.min_transmittance
            });
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

/// A tensor's numbers in host memory.
pub(crate) fn read<const D: usize>(tensor: Tensor<D>) -> Result<Vec<f32>, RenderError> {
    tensor
        .try_into_vec_as::<f32>()
        .map_err(|error| RenderError::Device(format!("{error:?}")))
}

#[cfg(test)]
#[path = "frame/tests.rs"]
mod tests;
