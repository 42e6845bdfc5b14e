//! Names of quality tiers and model variants. The model crate defines their layers and samples;
//! the contract has their names.

/// The tier of those who name none.
pub const DEFAULT_TIER: &str = "splat";

/// Quality tiers, cheapest first, each with its trade-off.
pub const TIERS: &[(&str, &str)] = &[
    (
        "draft",
        "a first look: coarse surfaces, no fine texture, 32 samples per ray",
    ),
    (
        "fast",
        "a field: hash-grid detail, small networks, 64 samples per ray",
    ),
    (
        "balanced",
        "larger tables and networks, 96 samples per ray: sharper, and slower",
    ),
    (
        "splat",
        "the default: Gaussians on the body's surface, sharpest in a minute, pictures in real time",
    ),
    (
        "paper-lean",
        "the paper's sizes, without samples and gradients that hardly matter",
    ),
    (
        "paper",
        "the paper's sizes and training, exactly: every sample, 400,000 steps, made for GPUs",
    ),
];

/// Model variants of the paper's ablation.
pub const VARIANTS: &[(&str, &str)] = &[
    (
        "yoto",
        "everything: identity codes and the pose-conditioned code",
    ),
    (
        "no-pose-condition",
        "the identity code alone in place of the pose-conditioned code",
    ),
    (
        "no-identity",
        "neither identity codes nor pose condition: nothing learned tells people apart",
    ),
    ("humannerf", "one subject per model, no codes"),
];

/// A named point on a model's measured trade-off of time and fidelity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RenderTier {
    /// Name in requests.
    pub name: &'static str,
    /// Description.
    pub about: &'static str,
    /// Largest loss of PSNR against ground truth, dB; none: the model's own settings.
    pub loss_db: Option<f64>,
}

/// Render qualities by name, best first. Unlike [`TIERS`] they need no training: one model
/// renders all of them.
pub const RENDER_TIERS: &[RenderTier] = &[
    RenderTier {
        name: "full",
        about: "the model's own settings, for the best quality",
        loss_db: None,
    },
    RenderTier {
        name: "balanced",
        about: "the fastest within 0.1 dB of full",
        loss_db: Some(0.1),
    },
    RenderTier {
        name: "fast",
        about: "the fastest within 0.5 dB of full",
        loss_db: Some(0.5),
    },
    RenderTier {
        name: "draft",
        about: "the fastest within 2 dB of full",
        loss_db: Some(2.0),
    },
];

/// Whether `name` is a render tier.
pub fn is_render_tier(name: &str) -> bool {
    RENDER_TIERS.iter().any(|tier| tier.name == name)
}

/// `full, balanced, …` for error messages and help.
pub fn render_tiers() -> String {
    let names: Vec<&str> = RENDER_TIERS.iter().map(|tier| tier.name).collect();
    names.join(", ")
}

/// Whether `name` is a tier.
pub fn is_tier(name: &str) -> bool {
    TIERS.iter().any(|(tier, _)| *tier == name)
}

/// Whether `name` is a variant.
pub fn is_variant(name: &str) -> bool {
    VARIANTS.iter().any(|(variant, _)| *variant == name)
}

/// `draft, fast, …` for error messages and help.
pub fn listed(table: &[(&str, &str)]) -> String {
    table
        .iter()
        .map(|(name, _)| *name)
        .collect::<Vec<_>>()
        .join(", ")
}
