//! Every size, rate and threshold of the model, as data. A tier is a named configuration with a point on
//! the speed/accuracy curve; a variant switches off parts of the model. Both are settings of the same
//! code.

mod appearance;
mod capabilities;
mod check;
mod exposure;
mod field;
mod named_tiers;
mod pose_shapes;
mod refinement;
mod resolution;
mod sampling;
mod schedule;
mod setting;
mod sharing;
mod splats;

pub use appearance::Appearance;
pub use capabilities::Capabilities;
pub(crate) use check::check_precision;
pub use exposure::{ExposureConfig, LearnExposure};
pub use field::{CanonicalConfig, DensityActivation, Encoding, FieldConfig, MarchConfig};
pub use pose_shapes::PoseShapesConfig;
pub(crate) use refinement::RefinementStage;
pub use refinement::{Extent, Refine, RefinementConfig};
pub use resolution::Resolution;
pub use sampling::{SamplingConfig, SamplingStrategy};
pub use schedule::Schedule;
pub use setting::Setting;
pub use splats::SplatConfig;
pub use yoto_ops::Precision;

use serde::{Deserialize, Serialize};
use thiserror::Error;
use yoto_proto::tiers;

/// Invalid configuration.
#[derive(Debug, Error, PartialEq)]
pub enum ConfigError {
    /// No such tier.
    #[error("there is no tier '{0}'; tiers: {list}", list = tiers::listed(tiers::TIERS))]
    UnknownTier(String),
    /// No such variant.
    #[error("there is no variant '{0}'; variants: {list}", list = tiers::listed(tiers::VARIANTS))]
    UnknownVariant(String),
    /// A field is out of its range.
    #[error("{field}: {message}")]
    Field {
        /// Path of the field, e.g. `canonical.width`.
        field: &'static str,
        /// The values it may have.
        message: String,
    },
}

/// Configuration of one model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModelConfig {
    /// Name of the tier these numbers come from.
    pub tier: String,
    /// Parts of the model that are used.
    pub variant: Variant,
    /// Numerics that frames are rendered with.
    #[serde(default)]
    pub numerics: Numerics,
    /// Precision of the factors in the fields' networks.
    #[serde(default)]
    pub precision: Precision,
    /// Width of an identity code (paper: 256).
    pub code_width: usize,
    /// Motion weights.
    pub motion: MotionConfig,
    /// Pose correction.
    pub correction: CorrectionConfig,
    /// Pose-conditioned code.
    pub condition: ConditionConfig,
    /// Non-rigid field.
    pub non_rigid: NonRigidConfig,
    /// The representation in canonical space: a field, or splats. Their settings are beside the others,
    /// as in `splats.count` or `march.epsilon`.
    #[serde(flatten)]
    pub appearance: Appearance,
    /// Optimisation.
    pub optimise: OptimiseConfig,
    /// The person that each step learns from.
    #[serde(default)]
    pub sampling: SamplingConfig,
    /// Start of each part of the model, and learning rates over a run.
    pub schedule: Schedule,
    /// Refinement of the poses of training frames.
    #[serde(default)]
    pub refinement: RefinementConfig,
    /// Exposure of training frames.
    #[serde(default)]
    pub exposure: ExposureConfig,
}

/// The rows of the paper's ablation (docs/research/paper.md).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Variant {
    /// Everything.
    Yoto,
    /// The identity code in place of the pose-conditioned one.
    NoPoseCondition,
    /// No identity codes and no pose condition: all people share every learned parameter.
    NoIdentity,
    /// One subject per model, no codes.
    #[serde(rename = "humannerf")]
    HumanNerf,
}

/// Numerics that a frame is rendered with. Training always uses [`Numerics::Sound`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Numerics {
    /// Bounded, with finite gradients (docs/research/paper.md marks each place where they differ).
    #[default]
    Sound,
    /// The numerics of the released HumanNeRF program, for comparisons with it.
    Reference,
}

/// Motion weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MotionConfig {
    /// Grid nodes along the axes.
    pub resolution: Resolution,
    /// Grid nodes of what each person has beyond the shared logits in the `direct` form; none: as many as `resolution`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub own: Option<Resolution>,
    /// Source of the logits on the grid.
    #[serde(default)]
    pub form: MotionForm,
    /// The way from a posed body's points to canonical ones.
    #[serde(default)]
    pub unposing: Unposing,
}

impl MotionConfig {
    /// The grid of what each person has beyond the shared logits.
    pub(crate) fn own(&self) -> Resolution {
        self.own.unwrap_or(self.resolution)
    }
}

/// The way from a posed body's points to canonical ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Unposing {
    /// The mean of the points to which the bones carry a point, by their weights there (paper,
    /// eq. 1).
    #[default]
    Blend,
    /// The point that forward skinning carries there, searched from the blend.
    Inverse,
}

/// Source of the logits of the motion weights.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum MotionForm {
    /// The logits are parameters.
    #[default]
    Direct,
    /// A convolutional decoder computes the logits from an embedding per identity (HumanNeRF).
    /// Each layer, including the last one, doubles the resolution: the grid's resolution must be 2
    /// to the number of `channels` plus one.
    Deconv {
        /// Width of an identity's embedding (HumanNeRF: 256).
        embedding: usize,
        /// Width of the layer between embedding and first kernel (HumanNeRF: 1024).
        hidden: usize,
        /// Channels after each layer except the last (HumanNeRF: 512, 512, 256, 256).
        channels: Vec<usize>,
    },
}

impl MotionForm {
    /// The decoder with HumanNeRF's sizes.
    pub fn humannerf() -> Self {
        Self::Deconv {
            embedding: 256,
            hidden: 1024,
            channels: vec![512, 512, 256, 256],
        }
    }
}

/// Pose correction MLP (HumanNeRF).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CorrectionConfig {
    /// Hidden width.
    pub width: usize,
    /// Hidden layers.
    pub depth: usize,
}

/// Cross-attention between identity code and posed joints (paper eq. 3 to 5).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ConditionConfig {
    /// Frequency bands of the joints' encoding.
    pub bands: usize,
}

/// Non-rigid MLP (HumanNeRF, with the paper's code F_nr).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NonRigidConfig {
    /// Frequency bands.
    pub bands: usize,
    /// Hidden layers.
    pub layers: LayersConfig,
    /// Behaviour before the field's kick-in.
    #[serde(default)]
    pub before_kick_in: BeforeKickIn,
}

/// Behaviour of the non-rigid field before its kick-in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BeforeKickIn {
    /// Points are not moved, and the network is not evaluated.
    #[default]
    Rests,
    /// The network is evaluated with closed bands and a condition of zeros, and its output, equal
    /// for all points and poses, is added (HumanNeRF, `core/nets/human_nerf/network.py`).
    Runs,
}

/// Hidden layers with a second input in one of them and a code in another.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LayersConfig {
    /// Hidden width.
    pub width: usize,
    /// Hidden layers.
    pub depth: usize,
    /// Layer (from 0) that receives the encoding again.
    pub skip: Option<usize>,
    /// Layer (from 0) that receives the code.
    pub inject: usize,
}

/// Optimisation (docs/research/paper.md compares it with the paper's).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OptimiseConfig {
    /// Patches per step.
    pub patches: usize,
    /// Side length of a patch, pixels.
    pub patch_size: u32,
    /// Learning rate of the canonical network and the codes.
    pub rate: f64,
    /// Learning rate of the hash tables.
    pub table_rate: f64,
    /// Learning rate of the motion weights.
    pub motion_rate: f64,
    /// Learning rate of pose correction, non-rigid field and attention.
    pub slow_rate: f64,
    /// Weight of 1 − SSIM in objectives without LPIPS; the mean squared error has weight 1.
    pub ssim_weight: f64,
    /// Weight of the mean squared difference between a ray's opacity and the mask; 0: none. Pixels
    /// at a mask's soft edge count less, the nearer their coverage is to a half.
    #[serde(default)]
    pub mask_weight: f64,
    /// Share of the samples whose gradients are computed; 1: all. Samples with large gradients
    /// are drawn with a higher probability. Smaller shares make steps faster and noisier.
    #[serde(default = "whole")]
    pub backward_share: f32,
}

/// All samples.
fn whole() -> f32 {
    1.0
}

impl Variant {
    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Yoto => "yoto",
            Self::NoPoseCondition => "no-pose-condition",
            Self::NoIdentity => "no-identity",
            Self::HumanNerf => "humannerf",
        }
    }

    fn named(name: &str) -> Result<Self, ConfigError> {
        match name {
            "yoto" => Ok(Self::Yoto),
            "no-pose-condition" => Ok(Self::NoPoseCondition),
            "no-identity" => Ok(Self::NoIdentity),
            "humannerf" => Ok(Self::HumanNerf),
            _ => Err(ConfigError::UnknownVariant(name.into())),
        }
    }
}

#[cfg(test)]
mod tests;
