//! The named tiers, each a point on the speed/accuracy curve.

use super::{
    Appearance, BeforeKickIn, CanonicalConfig, ConditionConfig, ConfigError, CorrectionConfig,
    DensityActivation, Encoding, ExposureConfig, FieldConfig, LayersConfig, LearnExposure,
    MarchConfig, ModelConfig, MotionConfig, MotionForm, NonRigidConfig, Numerics, OptimiseConfig,
    PoseShapesConfig, Precision, Refine, RefinementConfig, Resolution, SamplingConfig, Schedule,
    SplatConfig, Unposing, Variant,
};

impl ModelConfig {
    /// The configuration of a named tier and variant.
    ///
    /// # Errors
    /// If either name is unknown.
    pub fn named(tier: &str, variant: &str) -> Result<Self, ConfigError> {
        let variant = Variant::named(variant)?;
        let config = match tier {
            "draft" => grid_tier(tier, variant, 6, 14, 32, 2, 32, [21, 22, 9]),
            "fast" => grid_tier(tier, variant, 8, 15, 64, 3, 64, [32, 33, 13]),
            "balanced" => grid_tier(tier, variant, 10, 17, 128, 4, 96, [44, 44, 17]),
            "splat" => splats(variant),
            "paper" => paper(variant),
            "paper-lean" => paper_lean(variant),
            _ => return Err(ConfigError::UnknownTier(tier.into())),
        };
        config.check()?;
        Ok(config)
    }

    /// HumanNeRF for one person, as its released program has it.
    pub fn humannerf() -> Self {
        paper(Variant::HumanNerf)
    }
}

/// A tier with hash tables for detail and small networks.
#[allow(clippy::too_many_arguments)]
fn grid_tier(
    tier: &str,
    variant: Variant,
    levels: usize,
    log2_rows: u32,
    width: usize,
    depth: usize,
    samples: usize,
    nodes: [usize; 3],
) -> ModelConfig {
    ModelConfig {
        tier: tier.into(),
        variant,
        numerics: Numerics::Sound,
        precision: Precision::F32,
        code_width: 64,
        motion: MotionConfig {
            // As many as in a cube of 16, 24 and 32 nodes, in cells that are about as wide as deep.
            resolution: Resolution::Axes(nodes),
            own: None,
            form: MotionForm::Direct,
            // Chosen by experiment (docs/research/quality.md).
            unposing: Unposing::Inverse,
        },
        correction: CorrectionConfig {
            width: 64,
            depth: 2,
        },
        condition: ConditionConfig { bands: 6 },
        non_rigid: NonRigidConfig {
            bands: 4,
            layers: LayersConfig {
                width: 32,
                depth: 3,
                skip: None,
                inject: 1,
            },
            before_kick_in: BeforeKickIn::Rests,
        },
        appearance: Appearance::Field(FieldConfig {
            canonical: CanonicalConfig {
                encoding: Encoding::Hash {
                    levels,
                    base: 16,
                    growth: 1.45,
                    log2_rows,
                    features: 2,
                    // Chosen by experiment (docs/research/tiers-experiments.md).
                    own_log2_rows: log2_rows - 3,
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
                // What is left out changes no colour of a picture by more than 0.004 (docs/research/quality.md).
                occupancy_alpha: 1e-3,
            },
        }),
        optimise: OptimiseConfig {
            patches: 8,
            patch_size: 12,
            rate: 3e-3,
            table_rate: 1e-2,
            motion_rate: 5e-2,
            slow_rate: 5e-4,
            ssim_weight: 0.02,
            // Chosen by experiment (docs/research/quality.md).
            mask_weight: 0.1,
            backward_share: 0.25,
        },
        sampling: SamplingConfig::FAIR,
        schedule: Schedule {
            steps: 5000,
            warm_up: 0.02,
            // Refinement takes its place, and precise poses lose by it (docs/research/refinement.md).
            correction: Schedule::NEVER,
            non_rigid: 0.3,
            all_bands: 0.8,
            final_rate: 0.05,
            restart: 0.9,
        },
        refinement: RefinementConfig {
            who: Refine::Auto,
            ..RefinementConfig::default()
        },
        exposure: ExposureConfig::default(),
    }
}

/// The tier `fast` with splats in place of its field (docs/research/splats-experiments.md has the experiments).
fn splats(variant: Variant) -> ModelConfig {
    let mut config = grid_tier("splat", variant, 8, 15, 64, 3, 64, [32, 33, 13]);
    config.appearance = Appearance::Splats(SplatConfig {
        pose_shapes: PoseShapesConfig::of_tier(),
        ..SplatConfig::default()
    });
    // What a person has beyond the shared weights needs no fine cells (docs/research/splats-experiments.md).
    config.motion.own = Some(Resolution::Axes([16, 17, 7]));
    config.optimise.ssim_weight = 0.2;
    config.optimise.mask_weight = 0.1;
    config.refinement.noise = 0.08;
    // A minute's training gains nothing by it (docs/research/splats-experiments.md).
    config.schedule.non_rigid = Schedule::NEVER;
    config.schedule.all_bands = Schedule::NEVER;
    config.exposure.who = LearnExposure::Auto;
    config
}

/// A foreground likelihood too small to change the f32 colour of a ray: half a unit in the last
/// place of 1. The likelihood is an upper bound of a sample's opacity.
const INVISIBLE: f32 = f32::EPSILON / 2.0;

/// The march of the paper: all samples, without an occupancy grid.
const ALL_SAMPLES: MarchConfig = MarchConfig {
    samples: 128,
    epsilon: INVISIBLE,
    min_transmittance: 0.0,
    occupancy_cells: 0,
    occupancy_alpha: 0.0,
};

/// The sizes and the training of the paper and of HumanNeRF, on which it builds, with all samples
/// and all gradients (docs/research/paper.md lists every choice).
fn paper(variant: Variant) -> ModelConfig {
    paper_sizes("paper", variant, ALL_SAMPLES)
}

/// The sizes and the training of the paper with a `march`.
fn paper_sizes(tier: &str, variant: Variant, march: MarchConfig) -> ModelConfig {
    ModelConfig {
        tier: tier.into(),
        variant,
        numerics: Numerics::Sound,
        precision: Precision::F32,
        code_width: 256,
        motion: MotionConfig {
            resolution: 32.into(),
            own: None,
            form: MotionForm::humannerf(),
            unposing: Unposing::Blend,
        },
        correction: CorrectionConfig {
            width: 256,
            depth: 4,
        },
        condition: ConditionConfig { bands: 6 },
        non_rigid: NonRigidConfig {
            bands: 6,
            layers: LayersConfig {
                width: 128,
                depth: 6,
                skip: Some(4),
                inject: 3,
            },
            before_kick_in: BeforeKickIn::Runs,
        },
        appearance: Appearance::Field(FieldConfig {
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
            march,
        }),
        optimise: OptimiseConfig {
            patches: 6,
            patch_size: 32,
            rate: 5e-4,
            table_rate: 5e-4,
            motion_rate: 5e-5,
            slow_rate: 5e-5,
            ssim_weight: 0.1,
            mask_weight: 0.0,
            backward_share: 1.0,
        },
        sampling: SamplingConfig::default(),
        schedule: Schedule::paper(),
        refinement: RefinementConfig::default(),
        exposure: ExposureConfig::default(),
    }
}

/// [`paper`] for slower machines: samples, gradients and ends of rays with little influence are
/// left out. docs/research/performance.md has the effect.
fn paper_lean(variant: Variant) -> ModelConfig {
    let march = MarchConfig {
        epsilon: 1e-2,
        min_transmittance: 1e-3,
        occupancy_cells: 64,
        // Below the opacity of a step before training: a density of 0.3/m over 1.6 cm.
        occupancy_alpha: 2e-3,
        ..ALL_SAMPLES
    };
    let mut config = paper_sizes("paper-lean", variant, march);
    config.optimise.backward_share = 0.05;
    config
}
