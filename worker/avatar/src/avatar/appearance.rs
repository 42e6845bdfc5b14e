//! The part of a model in canonical space, with its configuration.

use super::{Avatar, Posed};
use crate::config::{Appearance, FieldConfig, ModelConfig, SplatConfig};
use crate::field::canonical::{Canonical, FieldValues};
use crate::field::pose_shapes::HostShapes;
use crate::field::splats::{SplatValues, Splats};
use crate::host::ReadError;
use crate::motion::body::CanonicalBody;
use burn::module::Param;
use burn::tensor::Tensor;
use yoto_capture::camera::Pose;
use yoto_ops::{splat, warp};

/// A model with the canonical part of its tier.
pub enum AvatarAppearance<'a> {
    /// A field.
    Field(AvatarField<'a>),
    /// Splats.
    Splats(AvatarSplats<'a>),
}

/// A model with a field.
#[derive(Clone, Copy)]
pub struct AvatarField<'a> {
    avatar: &'a Avatar,
    model: &'a ModelConfig,
    /// Settings of the field and the march.
    pub config: &'a FieldConfig,
    /// The field.
    pub canonical: &'a Canonical,
}

/// A model with splats.
#[derive(Clone, Copy)]
pub struct AvatarSplats<'a> {
    avatar: &'a Avatar,
    model: &'a ModelConfig,
    /// Settings of the splats.
    pub config: &'a SplatConfig,
    /// One per identity.
    pub splats: &'a [Splats],
}

impl Avatar {
    /// The representation in canonical space; `model` is the configuration that the model was made by.
    ///
    /// # Panics
    /// If `config` is of another model.
    pub fn appearance<'a>(&'a self, model: &'a ModelConfig) -> AvatarAppearance<'a> {
        const OTHER: &str = "a configuration of another model";
        match &model.appearance {
            Appearance::Field(config) => AvatarAppearance::Field(AvatarField {
                avatar: self,
                model,
                config,
                canonical: self.canonical.as_ref().expect(OTHER),
            }),
            Appearance::Splats(config) => {
                assert!(self.canonical.is_none(), "{OTHER}");
                AvatarAppearance::Splats(AvatarSplats {
                    avatar: self,
                    model,
                    config,
                    splats: &self.splats,
                })
            }
        }
    }
}

impl AvatarField<'_> {
    /// Colour and density, canonical points `[N, 3]` before the non-rigid field, metres, and foreground
    /// likelihoods `[N]` at `points` `[N, 3]` of the posed body. `near` `[N, 3]` are their canonical
    /// points if they were found before, and only need gradients.
    pub fn evaluate(
        &self,
        body: &CanonicalBody,
        posed: &Posed,
        points: Tensor<2>,
        near: Option<Tensor<2>>,
    ) -> (FieldValues, Tensor<2>, Tensor<1>) {
        let (canonical, likelihood) = self.avatar.unpose(self.model, body, posed, points, near);
        let values = self.values(body, posed, canonical.clone());
        (values, canonical, likelihood)
    }

    /// Colour and density at `canonical` points `[N, 3]`, metres: the part of the model that
    /// follows the warp.
    pub fn values(&self, body: &CanonicalBody, posed: &Posed, canonical: Tensor<2>) -> FieldValues {
        self.canonical.forward(
            &self.config.canonical,
            self.avatar.apply_non_rigid(self.model, posed, canonical),
            posed.slot,
            body.hash.as_ref(),
            posed.code.clone(),
        )
    }
}

impl AvatarSplats<'_> {
    /// As [`Avatar::pose`].
    ///
    /// # Panics
    /// If the model has no identity in `slot`.
    pub fn pose(
        &self,
        body: &CanonicalBody,
        slot: usize,
        pose: &Pose,
        schedule_progress: f64,
    ) -> Posed {
        self.avatar
            .pose(self.model, body, slot, pose, schedule_progress)
    }

    /// The values of the splats of the identity in `slot`.
    ///
    /// # Errors
    /// If they can't be read from their device.
    pub(crate) fn values(&self, slot: usize) -> Result<SplatValues, ReadError> {
        let own = Avatar::own_slot(self.model, slot);
        self.avatar.splat_values(own)
    }

    /// Flags of the splats of the identity in `slot` that have a frozen colour; `None` if nothing was guessed.
    ///
    /// # Errors
    /// If the flags can't be read from their device.
    pub(crate) fn frozen_colours(&self, slot: usize) -> Result<Option<Vec<bool>>, ReadError> {
        let own = Avatar::own_slot(self.model, slot);
        self.avatar.frozen_colours(own)
    }

    /// The splats of a posed identity. Their bones are those of their canonical places: pose blend shapes move what bones
    /// carry.
    ///
    /// # Errors
    /// If the places can't be read from their device.
    ///
    /// # Panics
    /// If `posed` is of another model, with more identities.
    pub fn posed_splats(
        &self,
        body: &CanonicalBody,
        posed: &Posed,
    ) -> Result<splat::Splats, ReadError> {
        let splats = &self.splats[posed.slot];
        let means = self.canonical_means(posed);
        let weights = posed.weights.clone();
        let transforms = match (&splats.bones, &splats.bone_weights) {
            (Some(own), Some(base)) => warp::skin_surface::skin_surface(
                weights,
                posed.transforms.clone(),
                means.clone(),
                own.val().detach(),
                base.val().detach(),
                body.known_joints,
                &body.grid,
            ),
            _ => warp::skin::skin(weights, posed.known_transforms(), means.clone(), &body.grid),
        };
        let means = match (&self.avatar.pose_shapes, &posed.shaped_by) {
            (Some(shapes), Some(pose)) => {
                let (config, code) = (&self.config.pose_shapes, posed.code.clone());
                let offsets = shapes.offsets(config, posed.slot, body, &means, pose, code)?;
                means + offsets
            }
            _ => means,
        };
        Ok(splat::Splats {
            transforms,
            means,
            rotations: splats.rotations.val(),
            scales: splats.scales.val(),
            opacities: splats.opacities.val(),
            colours: splats.learning_colours(),
            harmonics: splats.harmonics.as_ref().map(Param::val),
            light: splats.light.val(),
        })
    }

    /// The canonical places `[N, 3]` of the splats of a posed identity, metres, before pose blend shapes.
    pub(super) fn canonical_means(&self, posed: &Posed) -> Tensor<2> {
        let means = self.splats[posed.slot].means.val();
        self.avatar.apply_non_rigid(self.model, posed, means)
    }

    /// Pose blend shapes in host memory for splats of a posed identity at canonical `means` `[N, 3]`; `None` if none take
    /// part.
    ///
    /// # Errors
    /// If the model can't be read from its device.
    pub(crate) fn host_shapes(
        &self,
        body: &CanonicalBody,
        posed: &Posed,
        means: &[f32],
    ) -> Result<Option<HostShapes>, ReadError> {
        let (Some(shapes), Some(_)) = (&self.avatar.pose_shapes, &posed.shaped_by) else {
            return Ok(None);
        };
        let (config, code) = (&self.config.pose_shapes, posed.code.clone());
        let device = posed.weights.device();
        HostShapes::read(shapes, config, posed.slot, body, means, code, &device).map(Some)
    }
}
