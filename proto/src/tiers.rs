//! Names of quality tiers and model variants. What they mean in layers and samples is the
//! model's business; that they exist is the contract's.

/// Quality tiers, cheapest first, each with what it gives up.
pub const TIERS: &[(&str, &str)] = &[
    (
        "draft",
        "a first look: coarse surfaces, no fine texture, 32 samples a ray",
    ),
    (
        "fast",
        "the default on a CPU: hash-grid detail, small networks, 64 samples a ray",
    ),
    (
        "balanced",
        "larger tables and networks, 96 samples a ray: sharper, and slower",
    ),
    ("paper", "the sizes of the paper: made for GPUs"),
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
        "one code, table and set of motion weights shared by everybody",
    ),
    ("humannerf", "one subject a model, no codes"),
];

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
