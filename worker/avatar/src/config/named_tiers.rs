//! The named tiers: each a place on the speed/accuracy curve.

use super::{
    CanonicalConfig, ConditionConfig, ConfigError, CorrectionConfig, DensityActivation, Encoding,
    LayersConfig, MarchConfig, ModelConfig, MotionConfig, MotionForm, NonRigidConfig, Numerics,
    OptimiseConfig, Precision, Sharing, Variant,
};

impl ModelConfig {
    /// The configuration of a named tier and variant.
    ///
    /// # Errors
    /// When either name is unknown.
    pub fn named(tier: &str, variant: &str) -> Result<Self, ConfigError> {
        let variant = Variant::named(variant)?;
        let config = match tier {
            "draft" => grid_tier(tier, variant, 6, 14, 32, 2, 32, 16),
            "fast" => grid_tier(tier, variant, 8, 15, 64, 3, 64, 24),
            "balanced" => grid_tier(tier, variant, 10, 17, 128, 4, 96, 32),
            "paper" => paper(variant),
            _ => return Err(ConfigError::UnknownTier(tier.into())),
        };
        config.check()?;
        Ok(config)
    }

    /// HumanNeRF, for one person, at its released sizes. It was trained with every sample, and
    /// leaves out fewer when it renders.
    pub fn humannerf() -> Self {
        let mut config = paper(Variant::HumanNerf);
        config.march.epsilon = 1e-4;
        config
    }
}

/// A tier whose detail is in hash tables and whose networks are small.
#[allow(clippy::too_many_arguments)]
fn grid_tier(
    tier: &str,
    variant: Variant,
    levels: usize,
    log2_rows: u32,
    width: usize,
    depth: usize,
    samples: usize,
    resolution: usize,
) -> ModelConfig {
    ModelConfig {
        tier: tier.into(),
        variant,
        numerics: Numerics::Sound,
        precision: Precision::F32,
        code_width: 64,
        motion: MotionConfig {
            resolution,
            form: MotionForm::Direct,
        },
        correction: CorrectionConfig {
            width: 64,
            depth: 2,
            kick_in: 1500,
        },
        condition: ConditionConfig {
            bands: 6,
            attention_scale: false,
        },
        non_rigid: NonRigidConfig {
            bands: 4,
            layers: LayersConfig {
                width: 32,
                depth: 3,
                skip: None,
                inject: 1,
            },
            kick_in: 1500,
            full_at: 4000,
        },
        canonical: CanonicalConfig {
            encoding: Encoding::Hash {
                levels,
                base: 16,
                growth: 1.45,
                log2_rows,
                features: 2,
                // By experiment (docs/tiers.md).
                sharing: Sharing::Split {
                    own_log2_rows: log2_rows - 3,
                },
            },
            layers: LayersConfig {
                width,
                depth,
                skip: None,
                inject: 1,
            },
            density_scale: 50.0,
            activation: DensityActivation::Softplus,
        },
        march: MarchConfig {
            samples,
            epsilon: 1e-3,
            min_transmittance: 1e-3,
            occupancy_cells: 64,
            occupancy_alpha: 2e-3,
        },
        optimise: OptimiseConfig {
            patches: 8,
            patch_size: 12,
            rate: 3e-3,
            table_rate: 1e-2,
            motion_rate: 1e-2,
            slow_rate: 5e-4,
            final_rate: 0.05,
            ssim_weight: 0.02,
            backward_share: 0.25,
        },
    }
}

/// The sizes of the paper and of HumanNeRF, which it stands on.
fn paper(variant: Variant) -> ModelConfig {
    ModelConfig {
        tier: "paper".into(),
        variant,
        numerics: Numerics::Sound,
        precision: Precision::F32,
        code_width: 256,
        motion: MotionConfig {
            resolution: 32,
            form: MotionForm::humannerf(),
        },
        correction: CorrectionConfig {
            width: 256,
            depth: 4,
            kick_in: 0,
        },
        condition: ConditionConfig {
            bands: 6,
            attention_scale: false,
        },
        non_rigid: NonRigidConfig {
            bands: 6,
            layers: LayersConfig {
                width: 128,
                depth: 6,
                skip: Some(4),
                inject: 3,
            },
            kick_in: 10_000,
            full_at: 50_000,
        },
        canonical: CanonicalConfig {
            encoding: Encoding::Fourier { bands: 10 },
            layers: LayersConfig {
                width: 256,
                depth: 8,
                skip: Some(5),
                inject: 5,
            },
            density_scale: 1.0,
            activation: DensityActivation::Softplus,
        },
        march: MarchConfig {
            samples: 128,
            // By experiment, as is the share of gradients below (docs/performance.md).
            epsilon: 1e-2,
            min_transmittance: 1e-3,
            occupancy_cells: 64,
            // Under what a step holds before anything is learned: 0.3/m over 1.6 cm.
            occupancy_alpha: 2e-3,
        },
        optimise: OptimiseConfig {
            patches: 6,
            patch_size: 32,
            rate: 5e-4,
            table_rate: 5e-4,
            motion_rate: 5e-5,
            slow_rate: 5e-5,
            // 0.1^(400 k / 500 k) over a whole run.
            final_rate: 0.158,
            ssim_weight: 0.1,
            backward_share: 0.05,
        },
    }
}
