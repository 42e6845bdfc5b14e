//! The trade of time for quality on one's own captures: what training longer or in a larger
//! tier gives, and what rendering faster costs.

mod charts;
mod rows;
mod training;

use crate::captures::{self, Recording, Split};
use crate::display::Screen;
use crate::report::SplitScores;
use crate::training::pick_device;
use anyhow::{Context, ensure};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};
use yoto_avatar::evaluate::Protocol;
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_avatar::render::{RenderView, Renderer};
use yoto_avatar::tradeoff::{Axes, Curve, Machine, SweepError, SweepOptions, SweepView, sweep};
use yoto_proto::protocols::HELD_OUT;
use yoto_proto::v1::Progress;

pub use rows::summary;

/// Version of `tradeoff.json` written by this program.
const VERSION: u32 = 1;

/// What to measure on, and how.
#[derive(Debug, Clone)]
pub struct TradeoffOptions {
    /// Capture folders, one a person.
    pub captures: Vec<PathBuf>,
    /// Longest side of the pictures, pixels.
    pub size: u32,
    /// Quality tiers to train, cheapest first.
    pub tiers: Vec<String>,
    /// Seconds of training, shortest first; each is a training of its own, since learning
    /// rates fall towards a budget's end.
    pub budgets: Vec<f64>,
    /// Seed of everything random.
    pub seed: u64,
    /// At most this many held-out pictures of each kind and person are measured.
    pub pictures: usize,
    /// Held-out views that each render setting is measured on.
    pub views: usize,
    /// Timed renders of each view and setting.
    pub repeats: usize,
    /// Weights of the networks of LPIPS; without them LPIPS is neither measured nor minimised.
    pub lpips: Option<LpipsWeights>,
}

/// `tradeoff.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Tradeoff {
    /// Version of this form.
    pub version: u32,
    /// When it was measured, seconds since 1970.
    pub unix_seconds: u64,
    /// Where.
    pub machine: Machine,
    /// Names of the people.
    pub people: Vec<String>,
    /// Longest side of the pictures, pixels.
    pub size: u32,
    /// What was trained; empty when a trained model was measured.
    pub training: Vec<Trained>,
    /// Rendering, a curve a model: of each tier the one that was trained longest.
    pub rendering: Vec<Curve>,
}

/// What one tier reached with one budget.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trained {
    /// Quality tier.
    pub tier: String,
    /// Seconds that it had.
    pub budget_seconds: f64,
    /// Seconds that it took, without evaluation.
    pub train_seconds: f64,
    /// Steps taken.
    pub steps: u64,
    /// Trained numbers.
    pub parameters: u64,
    /// Size of a checkpoint with optimiser state, bytes.
    pub checkpoint_bytes: u64,
    /// Most memory that this process had resident during the training, its captures included,
    /// bytes; absent where the system does not tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub peak_memory_bytes: Option<u64>,
    /// What was minimised.
    pub objective: String,
    /// Figures on pictures that were never trained on.
    pub scores: SplitScores,
}

/// Trains each tier with each budget, and sweeps over render settings of the longest trained.
///
/// # Errors
/// At the first thing that fails, saying what.
pub fn run(options: &TradeoffOptions, screen: &dyn Screen) -> anyhow::Result<Tradeoff> {
    ensure!(!options.tiers.is_empty(), "--tiers: names no tier");
    ensure!(!options.budgets.is_empty(), "--budgets: names no budget");
    let protocol = Protocol::named(HELD_OUT)?;
    let recordings = captures::read_all(&options.captures, options.size, protocol, screen)?;
    let picked = pick_device(screen);
    let unix_seconds = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |since| since.as_secs());
    let machine = picked.machine();
    let bench = training::Bench {
        options,
        screen,
        protocol,
        recordings: &recordings,
        picked: &picked,
    };
    let (mut training, mut rendering) = (Vec::new(), Vec::new());
    for tier in &options.tiers {
        let mut longest = None;
        for &seconds in &options.budgets {
            let (trained, renderer) = bench
                .train(tier, seconds)
                .with_context(|| format!("tier {tier}, {seconds} s"))?;
            training.push(trained);
            longest = Some(renderer);
        }
        if let Some(mut renderer) = longest {
            let views = views(&recordings, options.views);
            let sweep = SweepOptions {
                settings: Axes::around(&renderer.settings(), &renderer.precisions()).settings(),
                repeats: options.repeats,
                machine: machine.clone(),
                unix_seconds,
            };
            rendering.push(render(&mut renderer, &views, &sweep, tier, screen)?);
        }
    }
    Ok(Tradeoff {
        version: VERSION,
        unix_seconds,
        machine,
        people: recordings.iter().map(|it| it.name.clone()).collect(),
        size: options.size,
        training,
        rendering,
    })
}

/// Sweeps, showing how far it is.
fn render(
    renderer: &mut Renderer,
    views: &[SweepView],
    options: &SweepOptions,
    tier: &str,
    screen: &dyn Screen,
) -> anyhow::Result<Curve> {
    let mut display = screen.begin(&format!("rendering, {tier}"));
    let curve = sweep(renderer, views, options, |done, total| {
        display.progress(&Progress {
            phase: format!("frame {done} of {total}"),
            fraction: done as f64 / total.max(1) as f64,
            ..Progress::default()
        });
        Ok::<_, SweepError>(())
    })?;
    display.finish(&format!("{} settings", curve.points.len()));
    Ok(curve)
}

/// `wanted` held-out views of everybody together, with what was seen in them.
fn views(recordings: &[Recording], wanted: usize) -> Vec<SweepView> {
    let each = wanted.div_ceil(recordings.len().max(1));
    let of = |(slot, recording): (usize, &Recording)| {
        let views = recording.subset(Split::NovelView, each);
        let views = views.map(move |view| SweepView {
            view: RenderView {
                slot,
                pose: view.pose.clone(),
                camera: view.camera.clone(),
                background: [0.0; 3],
            },
            truth: Some(view.truth.rgb.clone()),
        });
        views.collect::<Vec<_>>()
    };
    recordings.iter().enumerate().flat_map(of).collect()
}

impl Tradeoff {
    /// What is known of a trained model: how it renders.
    pub fn of_model(name: &str, curve: Curve) -> Self {
        Self {
            version: VERSION,
            unix_seconds: curve.unix_seconds,
            machine: curve.machine.clone(),
            people: vec![name.to_owned()],
            size: curve.size,
            training: Vec::new(),
            rendering: vec![curve],
        }
    }

    /// Writes `tradeoff.json`, `tradeoff.csv` and the plots into `folder`; the files' paths.
    ///
    /// # Errors
    /// When a file can't be written.
    pub fn write(&self, folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
        std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
        let json = serde_json::to_vec_pretty(self).context("writing down the figures")?;
        let mut paths = Vec::new();
        for (name, bytes) in [
            ("tradeoff.json", json),
            ("tradeoff.csv", rows::csv(self).into_bytes()),
        ] {
            let path = folder.join(name);
            std::fs::write(&path, bytes).with_context(|| format!("writing {}", path.display()))?;
            paths.push(path);
        }
        for (name, plot) in charts::all(self) {
            paths.extend(crate::plot::write(&plot, folder, name)?);
        }
        Ok(paths)
    }
}
