//! Names of quality tiers and model variants. The model crate defines their layers and samples;
//! the contract has their names.

use crate::v1::RenderQuality;
use crate::v1::render_quality::Want;

/// The tier whose people consist of splats. People of all other tiers have fields.
pub const SPLATS: &str = "splat";

/// The default tier.
pub const DEFAULT_TIER: &str = SPLATS;

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
    /// What it asks for.
    pub goal: RenderGoal,
}

/// What a render tier asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RenderGoal {
    /// The model's own settings.
    Full,
    /// The fastest settings with at most this loss of PSNR against ground truth, dB.
    WithinDb(f64),
    /// The model's own settings, if it consists of splats; fields are refused.
    Splats,
}

/// Render qualities by name, best first, except the one that only splats have. Unlike [`TIERS`] they need no
/// training: one model renders all of them.
pub const RENDER_TIERS: &[RenderTier] = &[
    RenderTier {
        name: "full",
        about: "the model's own settings, for the best quality",
        goal: RenderGoal::Full,
    },
    RenderTier {
        name: "balanced",
        about: "the fastest within 0.1 dB of full",
        goal: RenderGoal::WithinDb(0.1),
    },
    RenderTier {
        name: "fast",
        about: "the fastest within 0.5 dB of full",
        goal: RenderGoal::WithinDb(0.5),
    },
    RenderTier {
        name: "draft",
        about: "the fastest within 2 dB of full",
        goal: RenderGoal::WithinDb(2.0),
    },
    RenderTier {
        name: "realtime",
        about: "of splats, the model's own settings; fields are not drawn in real time",
        goal: RenderGoal::Splats,
    },
];

/// The render tier called `name`.
pub fn render_tier(name: &str) -> Option<&'static RenderTier> {
    RENDER_TIERS.iter().find(|tier| tier.name == name)
}

/// Whether `name` is a render tier.
pub fn is_render_tier(name: &str) -> bool {
    render_tier(name).is_some()
}

/// Whether `quality` needs the measured trade-off of a checkpoint.
pub fn needs_tradeoff(quality: &RenderQuality) -> bool {
    goal(quality) != Some(RenderGoal::Splats)
}

/// The reason why a model of the tier `model` can't be rendered in `quality`; `None` if it can.
pub fn refusal(quality: &RenderQuality, model: &str) -> Option<String> {
    let real_time = goal(quality) == Some(RenderGoal::Splats);
    (real_time && model != SPLATS).then(|| {
        format!(
            "the model's tier, {model}, has fields, which are not drawn in real time: train a model with the tier \
             {SPLATS}, or play a page of the person (`yoto export --out NAME.html`)"
        )
    })
}

fn goal(quality: &RenderQuality) -> Option<RenderGoal> {
    match &quality.want {
        Some(Want::Tier(name)) => render_tier(name).map(|tier| tier.goal),
        _ => None,
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn real_time_is_for_splats_alone_and_measured_with_nobody() {
        let tier = |name: &str| RenderQuality {
            want: Some(Want::Tier(name.into())),
        };
        let real_time = tier("realtime");
        assert!(!needs_tradeoff(&real_time));
        assert_eq!(refusal(&real_time, SPLATS), None);
        let said = refusal(&real_time, "fast").expect("has fields");
        assert!(said.contains("yoto export"), "{said}");
        let seconds = RenderQuality {
            want: Some(Want::MaxSecondsPerFrame(0.1)),
        };
        for measured in [tier("full"), tier("draft"), seconds] {
            assert!(needs_tradeoff(&measured), "{measured:?}");
            assert_eq!(refusal(&measured, "fast"), None);
        }
    }
}
