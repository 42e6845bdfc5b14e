//! The trade-off of time and quality on given captures: the gain of longer training or a larger
//! tier, and the cost of faster rendering.

mod training;

use crate::captures::{self, Recording, Split};
use crate::display::Screen;
use crate::training::pick_device;
use anyhow::{Context, ensure};
use std::path::PathBuf;
use std::time::{SystemTime, UNIX_EPOCH};
use yoto_avatar::evaluate::Protocol;
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_avatar::render::{RenderView, Renderer};
use yoto_avatar::tradeoff::{Axes, Curve, SweepError, SweepOptions, SweepView, Tradeoff, sweep};
use yoto_proto::protocols::HELD_OUT;
use yoto_proto::v1::Progress;

/// Settings of a measurement.
#[derive(Debug, Clone)]
pub struct TradeoffOptions {
    /// Capture folders, one per person.
    pub captures: Vec<PathBuf>,
    /// Longest side of the pictures, pixels.
    pub size: u32,
    /// Quality tiers to train, cheapest first.
    pub tiers: Vec<String>,
    /// Seconds of training, shortest first; each is a separate training, since learning rates
    /// decrease towards a budget's end.
    pub budgets: Vec<f64>,
    /// Random seed.
    pub seed: u64,
    /// At most this many held-out pictures of each kind and person are measured.
    pub pictures: usize,
    /// Held-out views to measure each render setting on.
    pub views: usize,
    /// Timed renders of each view and setting.
    pub repeats: usize,
    /// Weights of the networks of LPIPS; without them LPIPS is neither measured nor minimised.
    pub lpips: Option<LpipsWeights>,
}

/// Trains each tier with each budget, and sweeps over render settings of the longest trained.
///
/// # Errors
/// The first failure.
pub fn run(options: &TradeoffOptions, screen: &dyn Screen) -> anyhow::Result<Tradeoff> {
    ensure!(!options.tiers.is_empty(), "--tiers: at least one is needed");
    ensure!(
        !options.budgets.is_empty(),
        "--budgets: at least one is needed"
    );
    let protocol = Protocol::named(HELD_OUT)?;
    let mut recordings = captures::read_all(&options.captures, options.size, protocol, screen)?;
    let picked = pick_device(screen);
    let unix_seconds = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |since| since.as_secs());
    let machine = picked.machine();
    let session = training::Session {
        options,
        screen,
        protocol,
        picked: &picked,
    };
    let (mut training, mut rendering) = (Vec::new(), Vec::new());
    for tier in &options.tiers {
        let mut longest = None;
        for &seconds in &options.budgets {
            let (trained, renderer) = session
                .train(tier, seconds, &mut recordings)
                .with_context(|| format!("tier {tier}, {seconds} s"))?;
            training.push(trained);
            longest = Some(renderer);
        }
        if let Some(mut renderer) = longest {
            let views = views(&recordings, options.views);
            let sweep = SweepOptions {
                settings: Axes::of(&renderer).settings(),
                repeats: options.repeats,
                machine: machine.clone(),
                unix_seconds,
            };
            rendering.push(render(&mut renderer, &views, &sweep, tier, screen)?);
        }
    }
    Ok(Tradeoff {
        version: Tradeoff::VERSION,
        unix_seconds,
        machine,
        people: recordings.iter().map(|it| it.name.clone()).collect(),
        size: options.size,
        training,
        rendering,
    })
}

/// Sweeps over render settings, and shows the progress.
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

/// `wanted` held-out views over all people, with ground truth.
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
            truth: Some(view.truth.clone()),
            exposure: view.exposure,
        });
        views.collect::<Vec<_>>()
    };
    recordings.iter().enumerate().flat_map(of).collect()
}
