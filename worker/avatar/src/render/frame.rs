//! Rendering of whole frames: people in poses, from a camera.

use super::enlarge::enlarge;
use super::occupancy::Occupancy;
use super::rest_splats::RestSplatsCache;
use super::samples::SampleCounts;
use super::settings::RenderSettings;
use super::view::{RenderView, SceneView};
use crate::avatar::{Avatar, AvatarAppearance};
use crate::config::{ModelConfig, Numerics, Precision, check_precision};
use crate::host::ReadError;
use crate::motion::body::CanonicalBody;
use crate::pool::in_pool;
use burn::tensor::{Device, ExecutionError};
use std::collections::BTreeSet;
use thiserror::Error;
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::{Skeleton, SkeletonError};
use yoto_ops::composite::RayAccumulator;

/// Rendering error.
#[derive(Debug, Error)]
pub enum RenderError {
    /// The model has no identity in the slot.
    #[error("the model has no identity in slot {0}")]
    NoSuchSlot(usize),
    /// A scene names a model that it does not have.
    #[error("the scene has no model with the index {0}")]
    NoSuchModel(usize),
    /// The identity in the slot was removed.
    #[error("the person in slot {0} was removed from the model")]
    Removed(usize),
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
    /// The model has no light apart from its colours.
    #[error(
        "only models of splats (tier splat) can be rendered in another light than their captures'"
    )]
    NoLight,
    /// The released program's numerics know one person per picture.
    #[error("a model with the released program's numerics renders one person per picture, not {0}")]
    OnePerson(usize),
    /// The caller did not want the rest of the frame.
    #[error("the frame was not finished, as asked")]
    Stopped,
}

impl From<ReadError> for RenderError {
    fn from(error: ReadError) -> Self {
        Self::Device(error.into_message())
    }
}

impl From<ExecutionError> for RenderError {
    fn from(error: ExecutionError) -> Self {
        Self::Device(format!("{error:?}"))
    }
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
    /// The background of `view` alone.
    pub fn empty(view: &SceneView) -> Self {
        let (width, height) = (view.camera.width as usize, view.camera.height as usize);
        Self {
            width,
            height,
            rgb: view.background.repeat(width * height),
            alpha: vec![0.0; width * height],
            depth: vec![0.0; width * height],
            counts: SampleCounts::default(),
        }
    }

    /// Writes the sums of a pixel's ray over the background.
    pub(super) fn put(&mut self, pixel: usize, sums: &RayAccumulator, background: [f32; 3]) {
        for (c, background) in background.iter().enumerate() {
            self.rgb[3 * pixel + c] = sums.rgb[c] + (1.0 - sums.alpha) * background;
        }
        self.alpha[pixel] = sums.alpha;
        self.depth[pixel] = sums.depth;
    }

    /// `[H, W, 3]`, rounded to 8 bits.
    pub fn to_rgb8(&self) -> Vec<u8> {
        self.rgb.iter().copied().map(byte).collect()
    }

    /// `[H, W, 4]`, rounded to 8 bits: the colour of the person, and opacity, for a frame over a
    /// black background.
    pub fn to_rgba8(&self) -> Vec<u8> {
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

/// A number in [0, 1] in 8 bits. The nearest by cutting off after a half is added, which takes wide instructions;
/// rounding is a call on most machines.
fn byte(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// A trained model, ready to render.
pub struct Renderer {
    pub(super) config: ModelConfig,
    pub(super) avatar: Avatar,
    /// Bodies by slot.
    bodies: Vec<Option<CanonicalBody>>,
    /// Occupancy grids by slot; same length as `bodies`.
    pub(super) occupancy: Vec<Option<Occupancy>>,
    /// Completed fraction of the run, which determines the active parts of the model.
    pub(super) schedule_progress: f64,
    /// Slots of identities that were removed.
    removed: BTreeSet<usize>,
    /// Splats of people in the rest pose; as many slots as `bodies`.
    pub(super) rest_splats_cache: RestSplatsCache,
    settings: RenderSettings,
}

impl Renderer {
    /// A renderer with `bodies` and `occupancy` by slot. `avatar` and `bodies` are on the same
    /// device, without automatic differentiation.
    pub(crate) fn new(
        config: ModelConfig,
        avatar: Avatar,
        bodies: Vec<Option<CanonicalBody>>,
        occupancy: Vec<Option<Occupancy>>,
        schedule_progress: f64,
    ) -> Self {
        Self {
            settings: RenderSettings::of(&config),
            removed: BTreeSet::new(),
            rest_splats_cache: RestSplatsCache::new(bodies.len()),
            config,
            avatar,
            bodies,
            occupancy,
            schedule_progress,
        }
    }

    /// The same renderer without the identities of the `removed` slots.
    pub(crate) fn without(mut self, removed: BTreeSet<usize>) -> Self {
        self.removed = removed;
        self
    }

    /// Replaces the numerics of the model's configuration. A representation without reference numerics keeps sound ones.
    pub fn with_numerics(mut self, numerics: Numerics) -> Self {
        let can_change = self.config.appearance.capabilities().reference_numerics;
        if self.config.numerics != numerics && can_change {
            self.config.numerics = numerics;
            // Zeros of the prior depend on the numerics.
            for body in self.bodies.iter_mut().flatten() {
                let device = body.log_prior.device();
                let own = Skeleton {
                    rest: body.rest.clone(),
                    ..body.skeleton.clone()
                };
                let bones = body.skeleton.clone();
                *body = CanonicalBody::new(own, &self.config, &device).on_bones_of(bones);
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
        self.schedule_progress = iteration as f64 / self.config.schedule.steps as f64;
        self
    }

    /// Device of the model.
    pub(super) fn device(&self) -> Device {
        self.avatar.device()
    }

    /// Adds a body and returns its slot.
    pub(super) fn with_body(mut self, body: CanonicalBody) -> (Self, usize) {
        let slot = self.bodies.len();
        self.bodies.push(Some(body));
        self.occupancy.push(None);
        self.rest_splats_cache.add_slot();
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
        check_precision(settings.precision, &self.device())?;
        if settings.splats < 1.0 && !self.has_levels() {
            let message = "settings.splats: must be 1: only splats that bones alone move have levels of detail";
            return Err(RenderError::Settings(message.into()));
        }
        self.rest_splats_cache.choose(settings.splats);
        settings.apply(&mut self.config);
        self.avatar.set_precision(settings.precision);
        self.settings = *settings;
        Ok(())
    }

    /// Whether the number of splats can be reduced: the model has splats, and poses move them by bones alone.
    pub fn has_levels(&self) -> bool {
        let capable = self.config.appearance.capabilities().levels_of_detail;
        capable && !self.config.schedule.moves_points(self.schedule_progress)
    }

    /// Looks up what frames of the identities in `slots` need in all poses, with the present settings. Otherwise the
    /// first frame does, and takes longer.
    ///
    /// # Errors
    /// If a slot is empty, or the model can't be read from its device.
    pub fn prepare(&self, slots: impl IntoIterator<Item = usize>) -> Result<(), RenderError> {
        let splats = match self.avatar.appearance(&self.config) {
            AvatarAppearance::Splats(splats) => splats,
            // Frames of a field share nothing that could be computed before.
            AvatarAppearance::Field(_) => return Ok(()),
        };
        for slot in slots {
            let skeleton = self.skeleton(slot).ok_or_else(|| self.absence(slot))?;
            let body = self.body_in(slot, &Pose::rest(skeleton.joints()))?;
            self.rest_splats(splats, slot, body)?;
        }
        Ok(())
    }

    /// Precisions that this renderer's device supports.
    pub fn precisions(&self) -> Vec<Precision> {
        let device = self.device();
        let supported = |precision: &Precision| check_precision(*precision, &device).is_ok();
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

    /// The skeleton of the identity in `slot`.
    pub fn skeleton(&self, slot: usize) -> Option<&Skeleton> {
        self.bodies.get(slot)?.as_ref().map(|body| &body.skeleton)
    }

    /// Why nobody is in `slot`.
    pub fn absence(&self, slot: usize) -> RenderError {
        match self.removed.contains(&slot) {
            true => RenderError::Removed(slot),
            false => RenderError::NoSuchSlot(slot),
        }
    }

    /// Renders one view.
    ///
    /// # Errors
    /// As [`Self::render_scene`].
    pub fn render(&self, view: &RenderView) -> Result<Rendered, RenderError> {
        self.render_scene(&view.clone().into(), &mut |_| true)
    }

    /// Renders a view of any number of people until `keep_going` returns false, which gets the finished share of the
    /// frame before each batch of rays: a large frame takes minutes.
    ///
    /// # Errors
    /// If a slot is empty, a pose or the camera is invalid, or the model can't be lit as requested, and
    /// [`RenderError::Stopped`].
    pub fn render_scene(
        &self,
        view: &SceneView,
        keep_going: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Rendered, RenderError> {
        let (width, height) = (view.camera.width, view.camera.height);
        let (small_width, small_height) = self.settings.rendered_size(width, height);
        if (small_width, small_height) == (width, height) {
            return self.render_whole(view, keep_going);
        }
        let small = SceneView {
            camera: view.camera.resized(small_width, small_height),
            ..view.clone()
        };
        let frame = self.render_whole(&small, keep_going)?;
        enlarge(&frame, width as usize, height as usize)
    }

    /// The body in `slot`, once `pose` is a pose of it.
    pub(super) fn body_in(&self, slot: usize, pose: &Pose) -> Result<&CanonicalBody, RenderError> {
        let body = self.bodies.get(slot).and_then(Option::as_ref);
        let body = body.ok_or_else(|| self.absence(slot))?;
        body.skeleton.check_pose(pose)?;
        Ok(body)
    }

    /// Renders a view with one ray per pixel.
    fn render_whole(
        &self,
        view: &SceneView,
        keep_going: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Rendered, RenderError> {
        let actors = self.actor_bodies(view)?;
        match self.avatar.appearance(&self.config) {
            AvatarAppearance::Splats(splats) => {
                in_pool(|| self.render_splats(splats, &actors, view))
            }
            AvatarAppearance::Field(field) if self.config.numerics == Numerics::Reference => {
                self.render_as_released(field, &actors, view, keep_going)
            }
            AvatarAppearance::Field(field) => self.render_fields(field, &actors, view, keep_going),
        }
    }
}

#[cfg(test)]
#[path = "frame/tests.rs"]
mod tests;
