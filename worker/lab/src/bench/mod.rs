//! Time of one training step, stage by stage, on this machine.
//!
//! The captures are synthetic, so that anyone can run the same measurement. All parts of the model
//! are active from the first step on, regardless of their kick-in, unless they never are.

mod forms;
mod stages;

pub use forms::StepForm;

use crate::memory;
use anyhow::{Context, ensure};
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;
use yoto_avatar::config::{Appearance, ModelConfig, Precision, Setting};
use yoto_avatar::decoder::Prior;
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_avatar::render::RenderView;
use yoto_avatar::train::{Budget, Learn, TrainOptions, TrainPerson, Trainer, Validation};
use yoto_capture::ShardBuilder;
use yoto_synthetic::SyntheticPerson;

/// Frames of each person's video: a step uses one, so more would only take time to generate.
const FRAMES: usize = 6;
/// The consecutive spans of a step; all others are inside them.
const STAGES: [&str; 10] = [
    "draw",
    "pose",
    "march",
    "fields",
    "composite",
    "splat",
    "compare",
    "backward",
    "guard",
    "update",
];

/// Settings of a measurement.
#[derive(Clone, Debug)]
pub struct BenchOptions {
    /// The timed step.
    pub what: Timed,
    /// People in the model.
    pub people: usize,
    /// Side of their pictures, pixels.
    pub size: u32,
    /// Steps before the measurement, while caches fill and the occupancy grid takes
    /// effect.
    pub settle: u64,
    /// Timed steps.
    pub steps: u64,
    /// Whether to render a frame with the trained model as well.
    pub frame: bool,
    /// Whether to measure networks with bf16 factors as well.
    pub bf16: bool,
    /// Seed of people, weights and samples.
    pub seed: u64,
    /// Settings that replace the tier's.
    pub settings: Vec<Setting>,
    /// Weights of the networks of LPIPS; without them LPIPS is not minimised.
    pub lpips: Option<LpipsWeights>,
}

/// The timed step.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Timed {
    /// A step of a quality tier.
    Tier(String),
    /// A form of the paper's step.
    Form(StepForm),
}

/// One precision's figures.
#[derive(Clone, Debug, Serialize)]
pub struct StepTimes {
    /// Mean seconds of a step.
    pub step_seconds: f64,
    /// Mean seconds of each stage; `other` is the time outside all stages.
    pub stages: BTreeMap<String, f64>,
    /// Mean seconds of single operations, which are part of the stages.
    pub operations: BTreeMap<String, f64>,
    /// Peak memory during the steps, bytes; absent if the system does not report it.
    pub peak_bytes: Option<u64>,
    /// Mean number of samples per step evaluated by the networks.
    pub live_samples: f64,
    /// Number of samples per step along all rays.
    pub samples: u64,
    /// Seconds of one frame from a held-out camera, if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame_seconds: Option<f64>,
}

/// The whole measurement.
#[derive(Clone, Debug, Serialize)]
pub struct BenchReport {
    /// Quality tier.
    pub tier: String,
    /// Form of the paper's step, if one was timed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub form: Option<&'static str>,
    /// Number of parameters.
    pub parameters: u64,
    /// The training objective.
    pub objective: String,
    /// Steps before the measurement.
    pub settle: u64,
    /// Timed steps.
    pub steps: u64,
    /// Single precision.
    pub f32: StepTimes,
    /// Networks with bf16 factors, if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bf16: Option<StepTimes>,
    /// Peak memory overall, bytes.
    pub peak_bytes: Option<u64>,
    /// As in `f32`.
    pub live_samples: f64,
    /// As in `f32`.
    pub samples: u64,
}

/// Measures.
///
/// # Errors
/// When the tier is unknown, or a step fails.
pub fn run(options: &BenchOptions) -> anyhow::Result<BenchReport> {
    ensure!(options.steps > 0, "--steps: at least 1");
    let mut config = match &options.what {
        Timed::Tier(tier) => ModelConfig::named(tier, "yoto")?.with(&options.settings)?,
        Timed::Form(form) => form.config(&options.settings)?,
    };
    match config.appearance {
        Appearance::Field(_) => config.schedule = config.schedule.all_at_once(),
        // The non-rigid field never moves splats.
        Appearance::Splats(_) => {}
    }
    let cast = SyntheticPerson::cast(options.people, options.seed);
    let people = people(&cast, options.size)?;
    let device = yoto_device::pick().device;
    let mut measure = |precision| -> anyhow::Result<(StepTimes, Trainer)> {
        config.precision = precision;
        let training = training(options);
        let mut trainer = Trainer::new(config.clone(), training, people.clone(), &device)?;
        let mut times = times(&mut trainer, options)?;
        if options.frame {
            times.frame_seconds = Some(frame_seconds(&trainer, &cast, options.size)?);
        }
        Ok((times, trainer))
    };
    // One after the other, so that neither holds memory while the other is measured.
    let (f32, parameters, objective) = {
        let (times, trainer) = measure(Precision::F32)?;
        let objective = trainer.progress().objective.to_owned();
        (times, trainer.parameters(), objective)
    };
    let bf16 = match options.bf16 {
        true => Some(measure(Precision::Bf16)?.0),
        false => None,
    };
    Ok(BenchReport {
        tier: config.tier.clone(),
        form: match options.what {
            Timed::Form(form) => Some(form.name()),
            Timed::Tier(_) => None,
        },
        parameters,
        objective,
        settle: options.settle,
        steps: options.steps,
        peak_bytes: f32.peak_bytes,
        live_samples: f32.live_samples,
        samples: f32.samples,
        f32,
        bf16,
    })
}

/// Seconds per frame of the first person, in the first pose of the video: the second of two
/// renders, so that memory is already allocated.
fn frame_seconds(trainer: &Trainer, cast: &[SyntheticPerson], size: u32) -> anyhow::Result<f64> {
    let renderer = trainer.renderer();
    let person = cast.first().context("--people: at least 1")?;
    let camera = SyntheticPerson::held_out_cameras(size)
        .into_iter()
        .next()
        .context("no held-out camera")?;
    let pose = person.motion(FRAMES).into_iter().next();
    let view = RenderView {
        slot: 0,
        pose: pose.context("no pose")?,
        camera,
        background: [0.0; 3],
    };
    renderer.render(&view)?;
    let start = Instant::now();
    renderer.render(&view)?;
    Ok(start.elapsed().as_secs_f64())
}

fn people(cast: &[SyntheticPerson], size: u32) -> anyhow::Result<Vec<TrainPerson>> {
    cast.iter()
        .enumerate()
        .map(|(slot, person)| {
            let (track, film) = person.capture(FRAMES, size);
            let mut builder = ShardBuilder::new(track);
            for image in &film {
                builder.push(image)?;
            }
            let shard = Arc::new(builder.finish().context("packing a synthetic capture")?);
            Ok(TrainPerson {
                slot,
                name: person.name().to_owned(),
                shard,
            })
        })
        .collect()
}

fn training(options: &BenchOptions) -> TrainOptions {
    TrainOptions {
        refine_poses: None,
        exposure: None,
        harmonics: None,
        leave_unseen: false,
        prior: Prior::People,
        learn: Learn::Everything,
        budget: Budget::Steps(options.settle + options.steps),
        used_seconds: 0.0,
        used_steps: 0,
        seed: options.seed,
        image_size: 0,
        scratch: None,
        validation: Validation::NONE,
        lpips: options.lpips.clone(),
    }
}

fn times(trainer: &mut Trainer, options: &BenchOptions) -> anyhow::Result<StepTimes> {
    for _ in 0..options.settle {
        trainer.step()?;
    }
    let counted = memory::reset_peak();
    let before = trainer.progress().samples;
    let start = Instant::now();
    let (outcome, seconds) = stages::timed(|| {
        for _ in 0..options.steps {
            trainer.step()?;
        }
        anyhow::Ok(())
    });
    outcome?;
    let after = trainer.progress().samples;
    let steps = options.steps as f64;
    let step_seconds = start.elapsed().as_secs_f64() / steps;
    let mean = |pick: &dyn Fn(&str) -> bool| -> BTreeMap<String, f64> {
        seconds
            .iter()
            .filter(|(name, _)| pick(name))
            .map(|(name, seconds)| ((*name).to_owned(), seconds / steps))
            .collect()
    };
    let mut in_stages = mean(&|name| STAGES.contains(&name));
    let covered: f64 = in_stages.values().sum();
    in_stages.insert("other".into(), (step_seconds - covered).max(0.0));
    Ok(StepTimes {
        step_seconds,
        stages: in_stages,
        operations: mean(&|name| !STAGES.contains(&name)),
        peak_bytes: counted.ok().and_then(|()| memory::peak()),
        live_samples: (after.evaluated - before.evaluated) as f64 / steps,
        samples: (after.placed - before.placed) / options.steps,
        frame_seconds: None,
    })
}
