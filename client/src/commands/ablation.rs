//! `yoto ablation`: what each part of the model gives, on one's own captures.

use super::model::tier_help;
use super::paper_table::{Row, paper_table};
use super::table;
use crate::progress::Terminal;
use anyhow::Context;
use clap::Args;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use yoto_avatar::train::Budget;
use yoto_lab::ablation::{Ablation, AblationOptions, FILE, run};
use yoto_proto::v1::Scores;

const AFTER_HELP: &str = "\
Trains yoto, no-pose-condition, no-identity and humannerf one after the other on the same
captures with the same seed and budget, measures each on the captures' held-out views (eval/)
and poses (eval_pose/), and prints them beside the paper's table. humannerf knows one person
a model: its budget is divided among as many models as there are captures, so that every
variant trains equally long in total. The captures are laid out as `yoto quality --help` says.

OUT/ablation.json holds all figures, OUT/models/VARIANT/ the trained models.

Examples:
  yoto ablation --capture data/ada data/bob --seconds 600 --out out/ablation
  yoto ablation --capture data/ada data/bob --steps 2000 --size 64 --pictures 12 --out out";

/// Train the paper's four variants on the same captures and compare them.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct AblationCommand {
    /// Capture folder; give it again for each further person.
    #[arg(long = "capture", value_name = "DIR", required = true, num_args = 1..)]
    captures: Vec<PathBuf>,
    /// Budget of each variant in seconds of training.
    #[arg(long, value_name = "S", default_value = "300", value_parser = table::seconds, conflicts_with = "steps")]
    seconds: f64,
    /// Budget of each variant in steps, in place of seconds.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    steps: Option<u64>,
    /// Longest side of the pictures, pixels.
    #[arg(long, value_name = "PX", default_value_t = 128, value_parser = clap::value_parser!(u32).range(16..=4096))]
    size: u32,
    /// Quality tier: speed against detail.
    #[arg(long, default_value = "fast", value_parser = table::tier, long_help = tier_help())]
    tier: String,
    /// Seed of everything random.
    #[arg(long, default_value_t = 7)]
    seed: u64,
    /// Measure at most this many pictures of each kind and person [default: all].
    #[arg(long, value_name = "N")]
    pictures: Option<NonZeroUsize>,
    /// Folder for the figures and the models.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

impl AblationCommand {
    pub(super) fn run(self) -> anyhow::Result<()> {
        std::fs::create_dir_all(&self.out)
            .with_context(|| format!("making {}", self.out.display()))?;
        let options = AblationOptions {
            captures: self.captures,
            size: self.size,
            budget: match self.steps {
                Some(steps) => Budget::Steps(steps),
                None => Budget::Seconds(self.seconds),
            },
            tier: self.tier,
            seed: self.seed,
            pictures: self.pictures.map_or(usize::MAX, NonZeroUsize::get),
            out: self.out.clone(),
        };
        let ablation = run(&options, &Terminal)?;
        println!("{}", text(&ablation));
        println!("figures: {}", self.out.join(FILE).display());
        Ok(())
    }
}

/// The paper's table, what it rests on, and what the parts give.
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
            "{} at {} pixels, tier {}, seed {}, {budget} a variant, objective {}, on {}\n",
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

/// What the full model has over the one without a part.
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
    use yoto_lab::ablation::VariantScores;
    use yoto_lab::report::SplitScores;

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
            "ada, bob at 64 pixels, tier draft, seed 7, 300 steps a variant",
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
