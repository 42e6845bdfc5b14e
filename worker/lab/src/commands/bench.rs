//! `yoto-lab bench`: the time of a training step on this machine, stage by stage.

use super::args;
use crate::bench::{BenchOptions, BenchReport, StepForm, StepTimes, Timed, run};
use anyhow::Context;
use clap::{Args, value_parser};
use std::path::PathBuf;
use yoto_avatar::config::Setting;
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_terminal::args::LpipsArgs;
use yoto_terminal::output;

const AFTER_HELP: &str = "\
Trains on synthetic people, so that the same measurement can be run anywhere, with every part of
the model active. Run it on an otherwise idle machine.

Examples:
  yoto-lab bench --paper-step --json step.json
  yoto-lab bench --paper-step --form exact --f32-only
  yoto-lab bench --step fast --steps 50 --settle 200";

/// Time a whole training step, stage by stage.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct Bench {
    /// The paper's sizes: 6144 rays of 128 samples, in the forms of --form.
    #[arg(long, conflicts_with = "step", required_unless_present = "step")]
    paper_step: bool,
    /// Form of the paper's step: exact (all samples, all gradients), tuned (samples
    /// with a likelihood from 1e-3, all their gradients) or lean (as the tier paper-lean); may be
    /// repeated [default: all three].
    #[arg(long, value_name = "FORM", requires = "paper_step")]
    form: Vec<StepForm>,
    /// Quality tier of the timed step.
    #[arg(long, value_name = "TIER", value_parser = args::tier, long_help = args::tier_help())]
    step: Option<String>,
    /// Timed steps.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = value_parser!(u64).range(1..=100_000))]
    steps: u64,
    /// Steps before the measurement.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = value_parser!(u64).range(0..=1_000_000))]
    settle: u64,
    /// People in the model.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = value_parser!(u8).range(1..=64))]
    people: u8,
    /// Side of their pictures, pixels.
    #[arg(long, value_name = "PX", default_value_t = 512, value_parser = value_parser!(u32).range(16..=4096))]
    size: u32,
    /// Random seed.
    #[arg(long, default_value_t = 7)]
    seed: u64,
    /// Also time a rendered frame of the same size.
    #[arg(long)]
    frame: bool,
    /// Measure f32 only, without networks with bf16 factors.
    #[arg(long)]
    f32_only: bool,
    /// Another value for a setting of the tier, such as march.epsilon=1e-3; may be repeated.
    #[arg(long = "set", value_name = "NAME=VALUE")]
    settings: Vec<Setting>,
    /// Also write the figures as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    #[command(flatten)]
    lpips: LpipsArgs,
}

impl Bench {
    pub(super) fn run(self) -> anyhow::Result<()> {
        let timed: Vec<Timed> = match (self.step, self.form) {
            (Some(tier), _) => vec![Timed::Tier(tier)],
            (None, forms) if forms.is_empty() => StepForm::ALL.map(Timed::Form).into(),
            (None, forms) => forms.into_iter().map(Timed::Form).collect(),
        };
        let lpips = self.lpips.weights(LpipsWeights::both)?;
        let mut reports = Vec::new();
        for what in timed {
            let report = run(&BenchOptions {
                what,
                people: self.people.into(),
                size: self.size,
                settle: self.settle,
                steps: self.steps,
                frame: self.frame,
                bf16: !self.f32_only,
                seed: self.seed,
                settings: self.settings.clone(),
                lpips: lpips.clone(),
            })?;
            say!("{}", shown(&report).trim_end());
            reports.push(report);
        }
        say!("{}", rows(&reports).trim_end());
        output::put("steps", serde_json::to_value(&reports)?);
        if let Some(path) = &self.json {
            let json = serde_json::to_vec_pretty(&reports)?;
            std::fs::write(path, json).with_context(|| format!("writing {}", path.display()))?;
        }
        Ok(())
    }
}

/// One line per form of the paper's step; nothing for other steps.
fn rows(reports: &[BenchReport]) -> String {
    let mut text = String::new();
    let forms = reports.iter().filter_map(|it| Some((it.form?, it)));
    for (name, report) in forms {
        if text.is_empty() {
            text = "\n| form | computed | samples | f32, s | bf16, s | f32 frame, s | bf16 frame, s |\n\
                    |---|---|---:|---:|---:|---:|---:|\n"
                .into();
        }
        let about = name.parse().map_or("", StepForm::about);
        let step = |times: Option<&StepTimes>| {
            times.map_or("–".to_owned(), |it| format!("{:.2}", it.step_seconds))
        };
        let frame = |times: Option<&StepTimes>| {
            let seconds = times.and_then(|it| it.frame_seconds);
            seconds.map_or("–".to_owned(), |seconds| format!("{seconds:.1}"))
        };
        let (single, half) = (Some(&report.f32), report.bf16.as_ref());
        text += &format!(
            "| {name} | {about} | {:.0} | {} | {} | {} | {} |\n",
            report.f32.live_samples,
            step(single),
            step(half),
            frame(single),
            frame(half)
        );
    }
    text
}

fn shown(report: &BenchReport) -> String {
    let head = format!(
        "tier {}, {} parameters, objective {}; {} steps after {}\n",
        report.tier, report.parameters, report.objective, report.steps, report.settle
    );
    let bf16 = report.bf16.as_ref().map(|times| lines("bf16", times));
    head + &lines("f32", &report.f32) + &bf16.unwrap_or_default()
}

fn lines(precision: &str, times: &StepTimes) -> String {
    let mut text = format!("{precision}: {:.3} s per step\n", times.step_seconds);
    let parts = times.stages.iter().chain(&times.operations);
    for (name, seconds) in parts {
        let inside = times.operations.contains_key(name);
        let indent = if inside { "    " } else { "  " };
        let share = 100.0 * seconds / times.step_seconds;
        text += &format!("{indent}{name:<20} {seconds:>9.4} s {share:>5.1} %\n");
    }
    // Splats are not sampled along rays.
    if times.samples > 0 {
        text += &format!(
            "  samples {} placed, {:.0} evaluated ({:.1} %)\n",
            times.samples,
            times.live_samples,
            100.0 * times.live_samples / times.samples as f64
        );
    }
    if let Some(seconds) = times.frame_seconds {
        text += &format!("  frame {seconds:.3} s\n");
    }
    if let Some(bytes) = times.peak_bytes {
        text += &format!(
            "  peak memory {:.2} GiB\n",
            bytes as f64 / (1u64 << 30) as f64
        );
    }
    text
}
