//! Settings of the canonical field and of the rays that march through it.

use super::{ConfigError, LayersConfig};
use serde::{Deserialize, Serialize};

/// A field, and the march of rays through it.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldConfig {
    /// Canonical field.
    pub canonical: CanonicalConfig,
    /// Ray marching.
    pub march: MarchConfig,
}

/// Canonical field (HumanNeRF, with the paper's identity codes).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CanonicalConfig {
    /// Encoding of points.
    pub encoding: Encoding,
    /// Hidden layers.
    pub layers: LayersConfig,
    /// Factor on the activated output, 1/m (HumanNeRF: 1). Small networks do not reach densities
    /// of hundreds per metre quickly without one.
    pub density_scale: f32,
    /// Activation of the network's density output.
    #[serde(default)]
    pub activation: DensityActivation,
}

/// Activation of the density. Weights are trained with one of them, so it belongs to the model
/// and not to [`Numerics`](super::Numerics).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DensityActivation {
    /// softplus(raw − 1), which has a gradient everywhere.
    #[default]
    Softplus,
    /// max(raw, 0) (HumanNeRF). A network that starts below 0 everywhere never learns.
    Relu,
}

/// Encodings of a canonical point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum Encoding {
    /// The point, and sine and cosine of its multiples by powers of two (HumanNeRF: 10 bands).
    Fourier {
        /// Frequency bands.
        bands: usize,
    },
    /// Multiresolution hash grid.
    Hash {
        /// Levels.
        levels: usize,
        /// Cells per axis of the coarsest level.
        base: usize,
        /// Ratio of successive levels.
        growth: f64,
        /// Binary logarithm of the rows of the largest level.
        log2_rows: u32,
        /// Features per row: 1, 2, 4 or 8.
        features: usize,
        /// Binary logarithm of the rows of the largest level of an identity's own table. Its features are
        /// added to those of a table that all share (docs/research/tiers-experiments.md).
        #[serde(rename = "sharing", with = "super::sharing")]
        own_log2_rows: u32,
    },
}

impl Encoding {
    /// Number of frequency bands; 0 for a hash grid.
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
    /// Samples per ray.
    pub samples: usize,
    /// Samples with a foreground likelihood below this are not evaluated.
    pub epsilon: f32,
    /// Transmittance below which a ray ends; 0: rays never end early.
    #[serde(default)]
    pub min_transmittance: f32,
    /// Cells of a person's occupancy grid along the longest side of the box; 0: no grid.
    #[serde(default)]
    pub occupancy_cells: usize,
    /// A cell is empty if the opacity of the longest step is below this in the cell and its
    /// neighbours; 0: no grid.
    #[serde(default)]
    pub occupancy_alpha: f32,
}

impl FieldConfig {
    /// Checks all fields.
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        self.canonical.layers.check("canonical.layers")?;
        self.canonical.encoding.check()?;
        self.march.check()
    }
}

impl Encoding {
    /// Checks the sizes of a hash grid.
    fn check(&self) -> Result<(), ConfigError> {
        let fail = |field, message: &str| {
            Err(ConfigError::Field {
                field,
                message: message.into(),
            })
        };
        let Self::Hash {
            levels,
            base,
            growth,
            log2_rows,
            features,
            own_log2_rows,
        } = *self
        else {
            return Ok(());
        };
        let finest = base as f64 * growth.powi(levels as i32);
        if !(1..=32).contains(&levels)
            || base < 1
            || growth < 1.0
            || finest > 65_536.0
            || !(4..=24).contains(&log2_rows)
        {
            return fail(
                "canonical.encoding",
                "levels 1 to 32, base at least 1, growth at least 1, finest level under 65,536 cells, log2_rows 4 to 24",
            );
        }
        if ![1, 2, 4, 8].contains(&features) {
            return fail("canonical.encoding.features", "must be 1, 2, 4 or 8");
        }
        if !(4..=log2_rows).contains(&own_log2_rows) {
            return fail(
                "canonical.encoding.sharing.own_log2_rows",
                "must be 4 to log2_rows",
            );
        }
        Ok(())
    }
}

impl MarchConfig {
    /// Checks all fields.
    fn check(&self) -> Result<(), ConfigError> {
        let fail = |field, message: &str| {
            Err(ConfigError::Field {
                field,
                message: message.into(),
            })
        };
        if self.samples < 2 || !(0.0..1.0).contains(&self.epsilon) {
            return fail("march", "at least 2 samples, epsilon in [0, 1)");
        }
        if !(0.0..1.0).contains(&self.min_transmittance) {
            return fail("march.min_transmittance", "must be in [0, 1)");
        }
        if self.occupancy_cells > 512 || !(0.0..1.0).contains(&self.occupancy_alpha) {
            return fail(
                "march.occupancy",
                "at most 512 cells, occupancy_alpha in [0, 1)",
            );
        }
        Ok(())
    }
}
