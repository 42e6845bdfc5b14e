//! `yoto-lab ablation`: the effect of each part of the model, on given captures.

use super::args;
use super::screen::Terminal;
use crate::ablation::{Ablation, AblationOptions, FILE, People, VariantScores, run};
use anyhow::Context;
use clap::Args;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use yoto_avatar::config::Setting;
use yoto_avatar::evaluate::{Row, paper_table};
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_avatar::train::Budget;
use yoto_proto::v1::Scores;
use yoto_terminal::args::LpipsArgs;
use yoto_terminal::output;

const AFTER_HELP: &str = "\
Trains yoto, no-pose-condition, no-identity and humannerf one after the other on the same
captures with the same seed and budget, measures each on the captures' held-out views (eval/)
and poses (eval_pose/), and prints them beside the paper's table. humannerf knows one person
per model: its budget is divided among as many models as there are captures, so that every
variant trains equally long in total. The captures are laid out as `yoto-lab quality --help` says.

With --people in place of captures, synthetic people are filmed whose clothes move with the pose
by a known rule; the error of the learned displacement is then measured as well.

OUT/ablation.json holds all figures, OUT/models/VARIANT/ the trained models; with several seeds
each has a folder of its own, OUT/seed-N.

Examples:
  yoto-lab ablation --capture data/ada data/bob --seconds 600 --out out/ablation
  yoto-lab ablation --capture data/ada data/bob --steps 2000 --size 64 --measure 12 --out out
  yoto-lab ablation --people 3 --steps 1500 --seed 1 --seed 2 --seed 3 --out out/cloth";

/// Train the paper's four variants on the same captures and compare them.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct AblationCommand {
    /// Capture folder; give it again for each further person.
    #[arg(long = "capture", value_name = "DIR", required_unless_present = "people", num_args = 1..)]
    captures: Vec<PathBuf>,
    /// Number of synthetic people in clothes that move, in place of captures.
    #[arg(long, value_name = "N", conflicts_with = "captures", value_parser = clap::value_parser!(u8).range(1..=64))]
    people: Option<u8>,
    /// Budget of each variant in seconds of training.
    #[arg(long, value_name = "S", default_value = "300", value_parser = args::seconds, conflicts_with = "steps")]
    seconds: f64,
    /// Budget of each variant in steps, in place of seconds.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    steps: Option<u64>,
    /// Longest side of the pictures, pixels.
    #[arg(long, value_name = "PX", default_value_t = 128, value_parser = clap::value_parser!(u32).range(16..=4096))]
    size: u32,
    /// Quality tier: speed against detail.
    #[arg(long, default_value = "fast", value_parser = args::tier, long_help = args::tier_help())]
    tier: String,
    /// Seed of everything random; give it again to train with several and see the spread.
    #[arg(long = "seed", value_name = "N", default_values_t = [7])]
    seeds: Vec<u64>,
    /// Measure at most this many pictures of each kind and person [default: all].
    #[arg(long = "measure", alias = "pictures", value_name = "N")]
    pictures: Option<NonZeroUsize>,
    /// Write each held-out picture beside its render and a map of their difference, in DIR/pairs.
    #[arg(long)]
    pairs: bool,
    /// Only this variant; may be repeated [default: all].
    #[arg(long = "variant", value_name = "NAME", value_parser = args::variant)]
    variants: Vec<String>,
    /// Different value for one of the tier's settings, as in schedule.non_rigid=0.1; may be repeated.
    #[arg(long = "set", value_name = "NAME=VALUE")]
    settings: Vec<Setting>,
    /// Folder for the figures and the models.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    lpips: LpipsArgs,
}

impl AblationCommand {
    pub(super) fn run(self) -> anyhow::Result<()> {
        let lpips = self.lpips.weights(LpipsWeights::both)?;
        let mut files = Vec::new();
        let mut ablations = Vec::new();
        for &seed in &self.seeds {
            let out = match self.seeds.len() {
                1 => self.out.clone(),
                _ => self.out.join(format!("seed-{seed}")),
            };
            std::fs::create_dir_all(&out).with_context(|| format!("making {}", out.display()))?;
            let options = AblationOptions {
                people: match self.people {
                    Some(count) => People::Synthetic(count.into()),
                    None => People::Captures(self.captures.clone()),
                },
                size: self.size,
                budget: match self.steps {
                    Some(steps) => Budget::Steps(steps),
                    None => Budget::Seconds(self.seconds),
                },
                tier: self.tier.clone(),
                seed,
                pictures: self.pictures.map_or(usize::MAX, NonZeroUsize::get),
                pairs: self.pairs,
                out: out.clone(),
                variants: self.variants.clone(),
                settings: self.settings.clone(),
                lpips: lpips.clone(),
            };
            let ablation = run(&options, &Terminal)?;
            say!("{}", text(&ablation));
            say!("figures: {}", out.join(FILE).display());
            files.push(out.join(FILE));
            ablations.push(ablation);
        }
        output::put("files", output::paths(&files));
        if ablations.len() > 1 {
            say!("\n{}", spread(&ablations));
        }
        Ok(())
    }
}

/// Means over seeds, and half the range of each.
fn spread(ablations: &[Ablation]) -> String {
    let mut lines = vec![format!(
        "{:<18} {:>17} {:>17} {:>17} {:>17}",
        "mean (half range)", "views, dB", "poses, dB", "filmed, mm", "unseen, mm"
    )];
    let Some(first) = ablations.first() else {
        return String::new();
    };
    for (row, variant) in first.variants.iter().enumerate() {
        let of = |pick: &dyn Fn(&VariantScores) -> Option<f64>| {
            let rows = ablations.iter().filter_map(|it| it.variants.get(row));
            let values: Vec<f64> = rows.filter_map(pick).collect();
            if values.is_empty() {
                return "-".to_owned();
            }
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let low = values.iter().copied().fold(f64::INFINITY, f64::min);
            let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            format!("{mean:.2} (± {:.2})", 0.5 * (high - low))
        };
        lines.push(format!(
            "{:<18} {:>17} {:>17} {:>17} {:>17}",
            variant.variant,
            of(&|it| Some(it.mean.novel_view.psnr)),
            of(&|it| Some(it.mean.novel_pose.psnr)),
            of(&|it| it.displacement.map(|it| it.filmed.error_mm)),
            of(&|it| it.displacement.map(|it| it.unseen.error_mm))
        ));
    }
    lines.join("\n")
}

/// The paper's table, its conditions, and the gain of each part.
fn text(ablation: &Ablation) -> String {
    let rows: Vec<Row> = ablation
        .variants
        .iter()
        .map(|it| Row {
            variant: it.variant.clone(),
            scores: vec![
                Scores::from(&it.mean.novel_view),
                Scores::from(&it.mean.novel_pose),
            ],
        })
        .collect();
    let headings = ["held-out views".to_owned(), "held-out poses".to_owned()];
    let budget = match (ablation.budget_seconds, ablation.budget_steps) {
        (_, Some(steps)) => format!("{steps} steps"),
        (seconds, None) => format!("{:.0} s", seconds.unwrap_or_default()),
    };
    let mut lines = vec![
        format!(
            "{} at {} pixels, tier {}, seed {}, {budget} per variant, objective {}, on {}\n",
            ablation.captures.join(", "),
            ablation.size,
            ablation.tier,
            ablation.seed,
            ablation.objective,
            ablation.device
        ),
        paper_table(&headings, &rows),
        String::new(),
    ];
    for it in &ablation.variants {
        lines.push(format!(
            "{:<18} {} of {} steps in {:.0} s in all, {:.2} M parameters",
            it.variant,
            match it.models {
                1 => "1 model".to_owned(),
                models => format!("{models} models, the budget divided among them,"),
            },
            it.steps,
            it.train_seconds,
            it.parameters as f64 / 1e6
        ));
        if let Some(error) = &it.displacement {
            for (kind, error) in [("filmed", &error.filmed), ("unseen", &error.unseen)] {
                lines.push(format!(
                    "{:<18} clothes off by {:.2} mm in {kind} poses (by skinning alone {:.2}; by true \
                     skinning of clothes that never move {:.2})",
                    "", error.error_mm, error.skinned_mm, error.still_mm
                ));
            }
        }
        if !it.active_parts.is_empty() {
            lines.push(format!(
                "{:<18} active at the end: {}",
                "",
                it.active_parts.join(", ")
            ));
        }
    }
    for (part, without) in [
        ("pose condition", "no-pose-condition"),
        ("identity codes and pose condition", "no-identity"),
        ("one model for all", "humannerf"),
    ] {
        lines.extend(gain(ablation, part, without));
    }
    lines.join("\n")
}

/// Gain of the full model over the model without a part.
fn gain(ablation: &Ablation, part: &str, without: &str) -> Option<String> {
    let of = |variant: &str| ablation.variants.iter().find(|it| it.variant == variant);
    let (full, less) = (of("yoto")?.mean, of(without)?.mean);
    Some(format!(
        "{part}: {:+.2} dB on held-out views, {:+.2} dB on held-out poses (yoto over {without})",
        full.novel_view.psnr - less.novel_view.psnr,
        full.novel_pose.psnr - less.novel_pose.psnr
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_avatar::evaluate::SplitScores;

    #[test]
    fn the_text_says_what_each_part_gives_and_on_what_terms() {
        let variant = |name: &str, models: usize, psnr: f64| {
            let mut mean = SplitScores::mean(&[]);
            (mean.novel_view.psnr, mean.novel_pose.psnr) = (psnr, psnr - 1.0);
            VariantScores {
                variant: name.into(),
                models,
                steps: 300,
                train_seconds: 60.0,
                parameters: 1_000_000,
                skipped_steps: 0,
                subjects: Vec::new(),
                mean,
                displacement: None,
                active_parts: Vec::new(),
            }
        };
        let ablation = Ablation {
            captures: vec!["ada".into(), "bob".into()],
            tier: "draft".into(),
            size: 64,
            seed: 7,
            budget_seconds: None,
            budget_steps: Some(300),
            device: "cpu".into(),
            objective: "mse+ssim".into(),
            variants: vec![
                variant("yoto", 1, 27.0),
                variant("no-identity", 1, 25.5),
                variant("humannerf", 2, 26.0),
            ],
        };
        let text = text(&ablation);
        for expected in [
            "ada, bob at 64 pixels, tier draft, seed 7, 300 steps per variant",
            "2 models, the budget divided among them, of 300 steps",
            "identity codes and pose condition: +1.50 dB on held-out views, +1.50 dB",
            "one model for all: +1.00 dB",
        ] {
            assert!(text.contains(expected), "{expected} in\n{text}");
        }
        assert!(
            !text.contains("yoto over no-pose-condition"),
            "it was not measured"
        );
    }
}
