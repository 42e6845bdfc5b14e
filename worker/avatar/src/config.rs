//! Every size, rate and threshold of the model, as data. A tier is a named configuration with
//! a place on the speed/accuracy curve; a variant switches parts of the model off. Neither is
//! ever a fork of the code.

mod check;
mod named_tiers;
mod schedule;
mod setting;
mod sharing;

pub use schedule::Schedule;
pub use setting::Setting;
pub use sharing::Sharing;

use serde::{Deserialize, Serialize};
use thiserror::Error;
use yoto_proto::tiers;

/// A configuration that can't be.
#[derive(Debug, Error, PartialEq)]
pub enum ConfigError {
    /// No such tier.
    #[error("there is no tier '{0}'; tiers: {list}", list = tiers::listed(tiers::TIERS))]
    UnknownTier(String),
    /// No such variant.
    #[error("there is no variant '{0}'; variants: {list}", list = tiers::listed(tiers::VARIANTS))]
    UnknownVariant(String),
    /// A field out of its range.
    #[error("{field}: {message}")]
    Field {
        /// Path of the field, e.g. `canonical.width`.
        field: &'static str,
        /// What it must be.
        message: String,
    },
}

/// Everything that makes one model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModelConfig {
    /// Name of the tier these numbers come from.
    pub tier: String,
    /// Which parts take part.
    pub variant: Variant,
    /// How the released HumanNeRF program's unsound numerics are treated.
    #[serde(default)]
    pub numerics: Numerics,
    /// What the fields' networks multiply in.
    #[serde(default)]
    pub precision: Precision,
    /// Numbers of an identity code (paper: 256).
    pub code_width: usize,
    /// Motion weights.
    pub motion: MotionConfig,
    /// Pose correction.
    pub correction: CorrectionConfig,
    /// Pose-conditioned code.
    pub condition: ConditionConfig,
    /// Non-rigid field.
    pub non_rigid: NonRigidConfig,
    /// Canonical field.
    pub canonical: CanonicalConfig,
    /// Ray marching.
    pub march: MarchConfig,
    /// Optimisation.
    pub optimise: OptimiseConfig,
    /// What takes part when.
    pub schedule: Schedule,
}

/// The rows of the paper's ablation (docs/paper.md).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Variant {
    /// Everything.
    Yoto,
    /// The identity code in place of the pose-conditioned one.
    NoPoseCondition,
    /// No identity codes and no pose condition: one network for everybody that nothing learned
    /// tells apart.
    NoIdentity,
    /// One subject per model, no codes.
    #[serde(rename = "humannerf")]
    HumanNerf,
}

/// Which numerics a frame is rendered with. Training is always [`Numerics::Sound`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Numerics {
    /// Bounded, with finite gradients (model.md marks each place).
    #[default]
    Sound,
    /// As the released HumanNeRF program computes, to compare with it.
    Reference,
}

/// What the factors of the canonical and the non-rigid network's products are rounded to. Sums,
/// biases, results, parameters and everything outside of these networks are f32 either way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Precision {
    /// Not at all.
    #[default]
    F32,
    /// To bf16, 8 significant bits: half the time on CPUs with instructions for it. CPU only.
    Bf16,
}

/// Motion weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MotionConfig {
    /// Grid nodes an axis.
    pub resolution: usize,
    /// Where the logits on the grid come from.
    #[serde(default)]
    pub form: MotionForm,
}

/// What makes the logits of the motion weights.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum MotionForm {
    /// They are parameters themselves.
    #[default]
    Direct,
    /// A convolutional decoder makes them of an embedding a person (HumanNeRF). Each of its
    /// layers doubles the resolution, the last one included: two to the number of `channels`
    /// plus one must be the grid's resolution.
    Deconv {
        /// Numbers of an identity's embedding (HumanNeRF: 256).
        embedding: usize,
        /// Width of the layer between embedding and first kernel (HumanNeRF: 1024).
        hidden: usize,
        /// Channels after each layer but the last (HumanNeRF: 512, 512, 256, 256).
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

/// Pose correction MLP (model.md §3).
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

/// Non-rigid MLP (model.md §5).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NonRigidConfig {
    /// Frequency bands.
    pub bands: usize,
    /// Hidden layers.
    pub layers: LayersConfig,
    /// What the field does before its kick-in.
    #[serde(default)]
    pub before_kick_in: BeforeKickIn,
}

/// What the non-rigid field does before its kick-in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BeforeKickIn {
    /// Nothing: points stay where the bones put them, and the network costs no time.
    #[default]
    Rests,
    /// The network runs with closed bands and a condition of zeros, and its output, the same for
    /// every point and pose, is added (HumanNeRF, `core/nets/human_nerf/network.py`).
    Runs,
}

/// Hidden layers with a second input in one of them and a code in another.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LayersConfig {
    /// Hidden width.
    pub width: usize,
    /// Hidden layers.
    pub depth: usize,
    /// Layer (from 0) that gets the encoding once more.
    pub skip: Option<usize>,
    /// Layer that gets the code.
    pub inject: usize,
}

/// Canonical field (model.md §6).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CanonicalConfig {
    /// What the network sees of a point.
    pub encoding: Encoding,
    /// Hidden layers.
    pub layers: LayersConfig,
    /// Density is this times softplus(raw − 1), 1/m. The paper's raw density is the density;
    /// small networks can't reach hundreds per metre quickly and get a factor.
    pub density_scale: f32,
    /// What makes a density of the network's raw output.
    #[serde(default)]
    pub activation: DensityActivation,
}

/// From a raw output to a density. Weights are trained for one of them, so that it belongs to
/// the model and not to [`Numerics`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DensityActivation {
    /// softplus(raw − 1): alive everywhere.
    #[default]
    Softplus,
    /// max(raw, 0), as HumanNeRF has it: a network that starts under 0 everywhere never learns.
    Relu,
}

/// Encodings of a canonical point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum Encoding {
    /// The point and sin, cos of its multiples by powers of two (paper: 10 bands).
    Fourier {
        /// Frequency bands.
        bands: usize,
    },
    /// Multiresolution hash grid.
    Hash {
        /// Levels.
        levels: usize,
        /// Cells an axis of the coarsest level.
        base: usize,
        /// Ratio of successive levels.
        growth: f64,
        /// Largest level has 2 to this many rows.
        log2_rows: u32,
        /// Numbers of an identity's row: 1, 2, 4 or 8.
        features: usize,
        /// Which of its entries people share.
        #[serde(default)]
        sharing: Sharing,
    },
}

impl Encoding {
    /// Frequency bands; none with tables.
    pub fn bands(&self) -> usize {
        match self {
            Self::Fourier { bands } => *bands,
            Self::Hash { .. } => 0,
        }
    }
}

/// Ray marching (paper eq. 9; skipping by foreground likelihood).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MarchConfig {
    /// Samples a ray.
    pub samples: usize,
    /// A sample with a foreground likelihood under this is not evaluated.
    pub epsilon: f32,
    /// A ray ends where less light than this comes through; 0: none does.
    #[serde(default)]
    pub min_transmittance: f32,
    /// Cells of a person's occupancy grid on the box's longest side; 0: no grid.
    #[serde(default)]
    pub occupancy_cells: usize,
    /// A cell is empty when the longest step is less opaque than this in it and its neighbours;
    /// 0: no grid.
    #[serde(default)]
    pub occupancy_alpha: f32,
}

/// Optimisation (model.md §8).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OptimiseConfig {
    /// Patches a step.
    pub patches: usize,
    /// Side of a patch, pixels.
    pub patch_size: u32,
    /// Learning rate of the canonical network and the codes.
    pub rate: f64,
    /// Of the hash tables.
    pub table_rate: f64,
    /// Of the motion weights.
    pub motion_rate: f64,
    /// Of pose correction, non-rigid field and attention.
    pub slow_rate: f64,
    /// Share of 1 − SSIM in the loss, beside the mean squared error.
    pub ssim_weight: f64,
    /// Share of the samples with a gradient that it is computed of, the larger the likelier;
    /// 1: all. A smaller one makes steps faster and noisier.
    #[serde(default = "whole")]
    pub backward_share: f32,
}

/// All samples.
fn whole() -> f32 {
    1.0
}

impl ModelConfig {
    /// The same with a hash grid that people share like this.
    ///
    /// # Errors
    /// When the model has no hash grid, or not one that can be shared so.
    pub fn shared(mut self, kind: Sharing) -> Result<Self, ConfigError> {
        match &mut self.canonical.encoding {
            Encoding::Hash { sharing, .. } => *sharing = kind,
            Encoding::Fourier { .. } => {
                return Err(ConfigError::Field {
                    field: "canonical.encoding.sharing",
                    message: format!("the tier '{}' has no tables to share", self.tier),
                });
            }
        }
        self.check()?;
        Ok(self)
    }
}

impl Variant {
    /// As on the command line.
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
