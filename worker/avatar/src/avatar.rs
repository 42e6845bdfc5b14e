//! The whole model: shared networks and the parameters of each identity.

use crate::config::{Appearance, Encoding, ModelConfig, Numerics, Precision, Unposing, Variant};
use crate::field::canonical::Canonical;
use crate::field::non_rigid::NonRigid;
use crate::field::pose_shapes::PoseShapes;
use crate::field::splats::{SplatValues, Splats};
use crate::identity::blend::Blend;
use crate::identity::pose_condition::PoseCondition;
use crate::init::Initial;
use crate::motion::body::{CanonicalBody, hash_grid};
use crate::motion::correction::PoseCorrection;
use crate::motion::weights::MotionWeights;
use crate::motion::{posed, released};
use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use yoto_capture::camera::Pose;
use yoto_ops::hash::HashGrid;
use yoto_ops::warp;

mod appearance;
mod guesses;
mod skinning;
mod splats;

pub use appearance::{AvatarAppearance, AvatarField, AvatarSplats};

/// Standard deviation of the initial identity codes.
const CODE_STD: f64 = 0.01;

/// The parameters of one model. They are stored apart from its [`ModelConfig`], which the methods
/// take as an argument.
#[derive(Module, Debug)]
pub struct Avatar {
    /// One `[code_width]` per identity; none in variants without codes.
    pub codes: Vec<Param<Tensor<1>>>,
    /// Weights of the bones at each point.
    pub motion: MotionWeights,
    /// Correction of estimated poses.
    pub correction: PoseCorrection,
    /// Pose-conditioned code; absent in variants without it.
    pub condition: Option<PoseCondition>,
    /// Motion that bones do not explain.
    pub non_rigid: NonRigid,
    /// Pose blend shapes; only in models of splats.
    pub(crate) pose_shapes: Option<PoseShapes>,
    // Exactly one of these two is there: `Avatar::appearance` tells which. Burn names tensors after fields, so
    // that an enum would rename those of every checkpoint.
    /// Colour and density; absent in models of splats.
    pub(crate) canonical: Option<Canonical>,
    /// One per identity, in models of splats.
    pub(crate) splats: Vec<Splats>,
}

/// Size of one part of a model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PartCount {
    /// First component of the parameters' paths, e.g. `non_rigid`.
    pub part: String,
    /// Number of parameters.
    pub parameters: u64,
    /// Their size in memory or in the weights file.
    pub bytes: u64,
}

/// An identity in a pose at one point of the run: everything that is computed once per frame.
pub struct Posed {
    slot: usize,
    schedule_progress: f64,
    /// `[K + 1, V]` motion weights, or factors of those of a body's surface where splats lie on one.
    pub weights: Tensor<2>,
    /// `[J, 12]` posed body to canonical: of the K joints that the model knows, and of those of fingers after them.
    pub transforms: Tensor<2>,
    known_joints: usize,
    pose: Tensor<1>,
    code: Option<Tensor<1>>,
    /// F_nr; the code itself as long as the non-rigid field has no use for it. Whatever no backward pass
    /// reaches would stay in Burn's autodiff graph, and each step would search a larger one.
    conditioned: Option<Tensor<1>>,
    /// The pose, where pose blend shapes take part.
    shaped_by: Option<Pose>,
}

impl Posed {
    /// The slot whose parameters it has.
    pub(crate) fn slot(&self) -> usize {
        self.slot
    }

    /// `[K, 12]`: the transforms of the joints that the model knows.
    pub(crate) fn known_transforms(&self) -> Tensor<2> {
        let [joints, width] = self.transforms.dims();
        match self.known_joints == joints {
            true => self.transforms.clone(),
            false => (self.transforms.clone()).slice([0..self.known_joints, 0..width]),
        }
    }
}

impl Avatar {
    /// A model of `slots` identities whose skeletons have `joints` joints. Equal seeds give equal
    /// weights.
    pub fn new(
        config: &ModelConfig,
        slots: usize,
        joints: usize,
        seed: u64,
        device: &Device,
    ) -> Self {
        let init = Initial::new(device, seed);
        // Without identities, no learned parameter may distinguish people, so tables and
        // residuals are shared too.
        let identities = match config.variant {
            Variant::NoIdentity => slots.min(1),
            _ => slots,
        };
        let codes = match config.variant {
            Variant::HumanNerf | Variant::NoIdentity => 0,
            Variant::Yoto | Variant::NoPoseCondition => identities,
        };
        let code_width = if codes > 0 { config.code_width } else { 0 };
        let (canonical, splats) = match &config.appearance {
            Appearance::Field(field) => {
                let canonical = Canonical::new(
                    &init,
                    &field.canonical,
                    identities,
                    code_width,
                    any_grid(&field.canonical.encoding).as_ref(),
                    config.precision,
                );
                (Some(canonical), Vec::new())
            }
            Appearance::Splats(splats) => {
                let nobody = SplatValues::at_origin(splats.count);
                let of = |slot| Splats::new(&init, slot, &nobody, splats.harmonics);
                (None, (0..identities).map(of).collect())
            }
        };
        Self {
            codes: (0..codes)
                .map(|slot| init.normal(&format!("codes.{slot}"), [config.code_width], CODE_STD))
                .collect(),
            motion: MotionWeights::new(&init, &config.motion, identities, joints + 1),
            correction: PoseCorrection::new(&init, &config.correction, joints),
            condition: (config.variant == Variant::Yoto)
                .then(|| PoseCondition::new(&init, &config.condition, config.code_width)),
            non_rigid: NonRigid::new(
                &init,
                &config.non_rigid,
                3 * (joints - 1),
                code_width,
                config.precision,
            ),
            pose_shapes: PoseShapes::new(&init, config, joints, identities, code_width),
            canonical,
            splats,
        }
    }

    /// Number of parameters that each additional identity adds.
    pub fn parameters_of_a_person(config: &ModelConfig, joints: usize) -> u64 {
        let count = |slots| Self::new(config, slots, joints, 0, &Device::flex()).num_params();
        (count(2) - count(1)) as u64
    }

    /// The slot of the parameters of the identity in `slot`: without identities, all people have those of
    /// the first.
    pub(crate) fn own_slot(config: &ModelConfig, slot: usize) -> usize {
        match config.variant {
            Variant::NoIdentity => 0,
            _ => slot,
        }
    }

    /// Poses the identity in `slot`. `schedule_progress` is the completed fraction of the run; it
    /// determines which parts of the model are active.
    ///
    /// # Panics
    /// If the model has no identity in `slot`.
    pub fn pose(
        &self,
        config: &ModelConfig,
        body: &CanonicalBody,
        slot: usize,
        pose: &Pose,
        schedule_progress: f64,
    ) -> Posed {
        let slot = Self::own_slot(config, slot);
        let mut vector = posed::pose_vector(body, pose);
        let corrected = config.schedule.corrects(schedule_progress);
        let transforms = match config.numerics {
            Numerics::Sound => self.bones(config, body, pose, vector.clone(), schedule_progress),
            Numerics::Reference => {
                vector = vector + released::POSE_SHIFT;
                let correction =
                    corrected.then(|| released::rodrigues(self.correction.vectors(vector.clone())));
                released::transforms(body, pose, correction)
            }
        };
        let code = (!self.codes.is_empty()).then(|| self.codes[slot].val());
        let moves = config.schedule.moves_points(schedule_progress);
        let conditioned = match (self.condition.as_ref().filter(|_| moves), &code) {
            (Some(condition), Some(code)) => Some(condition.forward(
                &config.condition,
                code.clone(),
                posed::relative_joints(body, pose),
            )),
            (None, _) => code.clone(),
            (Some(_), None) => unreachable!("a pose condition without identity codes"),
        };
        Posed {
            slot,
            schedule_progress,
            weights: self.motion.volume(slot, self.log_prior(slot, body)),
            transforms,
            known_joints: body.known_joints,
            pose: vector,
            code,
            conditioned,
            shaped_by: (config.active_pose_shapes(schedule_progress)).map(|_| pose.clone()),
        }
    }

    /// Logarithm `[K + 1, V]` of what the volume of motion weights is about: the prior, or factors of 1 where splats have
    /// weights of a body's surface.
    fn log_prior(&self, slot: usize, body: &CanonicalBody) -> Tensor<2> {
        let splats = self.splats.get(slot);
        match splats.is_some_and(Splats::has_surface) {
            true => body.log_prior.zeros_like(),
            false => body.log_prior.clone(),
        }
    }

    /// `[J, 12]` posed to canonical of each bone, with sound numerics, from the pose and its `vector`
    /// ([`posed::pose_vector`]).
    pub(crate) fn bones(
        &self,
        config: &ModelConfig,
        body: &CanonicalBody,
        pose: &Pose,
        vector: Tensor<1>,
        schedule_progress: f64,
    ) -> Tensor<2> {
        if config.schedule.corrects(schedule_progress) {
            posed::corrected_transforms(body, pose, self.correction.forward(vector))
        } else {
            posed::transforms(body, pose)
        }
    }

    /// Canonical points `[N, 3]`, metres, before the non-rigid field, and foreground likelihoods
    /// `[N]` of `points` `[N, 3]` of the posed body.
    pub(crate) fn unpose(
        &self,
        config: &ModelConfig,
        body: &CanonicalBody,
        posed: &Posed,
        points: Tensor<2>,
        near: Option<Tensor<2>>,
    ) -> (Tensor<2>, Tensor<1>) {
        let [n, _] = points.dims();
        let warped = warp::warp(
            posed.weights.clone(),
            posed.known_transforms(),
            points.clone(),
            &body.grid,
        );
        let likelihood = warped.clone().slice([0..n, 3..4]).reshape([n]);
        let blend = warped.slice([0..n, 0..3]);
        let canonical = match config.motion.unposing {
            Unposing::Blend => blend,
            Unposing::Inverse => {
                let (near, steps) = match near {
                    Some(near) => (near, 1),
                    None => (blend.clone().detach(), warp::inverse::STEPS),
                };
                warp::inverse::unpose(
                    posed.weights.clone(),
                    posed.known_transforms(),
                    points,
                    near,
                    blend,
                    &body.grid,
                    steps,
                )
            }
        };
        (canonical, likelihood)
    }

    /// `canonical` points `[N, 3]`, metres, after the non-rigid field.
    pub(crate) fn apply_non_rigid(
        &self,
        config: &ModelConfig,
        posed: &Posed,
        canonical: Tensor<2>,
    ) -> Tensor<2> {
        let (pose, code) = (posed.pose.clone(), posed.conditioned.clone());
        self.non_rigid
            .forward(config, canonical, pose, code, posed.schedule_progress)
    }

    /// Appends an identity that is the mixture of two others; of splats, it has those of the first.
    pub(crate) fn append(&mut self, blend: &Blend) {
        // All fields, so that a further one is not forgotten.
        let Self {
            codes,
            motion,
            correction: _,
            condition: _,
            non_rigid: _,
            pose_shapes,
            canonical,
            splats,
        } = self;
        blend.append(codes);
        motion.append(blend);
        if let Some(shapes) = pose_shapes {
            shapes.append(blend);
        }
        if let Some(field) = canonical {
            field.append(blend);
        }
        if let Some(of_first) = splats.get(blend.from).cloned() {
            splats.push(of_first);
        }
    }

    /// Multiplies the opacity of the splats of the identity in `slot`.
    pub(crate) fn fade(&mut self, slot: usize, share: f32) {
        if let Some(splats) = self.splats.get_mut(slot) {
            splats.fade(share);
        }
    }

    /// Sets the precision that the fields' networks multiply in.
    pub(crate) fn set_precision(&mut self, precision: Precision) {
        // All fields, so that a further one is not forgotten.
        let Self {
            codes: _,
            motion: _,
            correction: _,
            condition: _,
            non_rigid,
            pose_shapes,
            canonical,
            splats: _,
        } = self;
        non_rigid.set_precision(precision);
        if let Some(shapes) = pose_shapes {
            shapes.set_precision(precision);
        }
        if let Some(field) = canonical {
            field.set_precision(precision);
        }
    }

    /// Device of the parameters.
    pub(crate) fn device(&self) -> Device {
        self.devices()
            .into_iter()
            .next()
            .expect("every model has parameters")
    }
}

/// The hash grid of an encoding over an arbitrary box: the number of rows does not depend on it.
fn any_grid(encoding: &Encoding) -> Option<HashGrid> {
    let anywhere = warp::WarpGrid {
        min: [0.0; 3],
        max: [1.0; 3],
        nodes: [2; 3],
        floor: 0.0,
    };
    hash_grid(encoding, &anywhere)
}

#[cfg(test)]
mod tests;
