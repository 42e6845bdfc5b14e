//! How long one step of training takes, stage by stage, on this machine.
//!
//! The captures are made up, so that anyone can run the same measurement. All parts of the model
//! take part from the first step on, whatever their kick-in.

mod forms;
mod stages;

pub use forms::StepForm;

use crate::memory;
use anyhow::{Context, ensure};
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;
use yoto_avatar::config::{ModelConfig, Precision, Setting};
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_avatar::render::RenderView;
use yoto_avatar::train::{Budget, Person, TrainOptions, Trainer};
use yoto_capture::ShardBuilder;
use yoto_capture::synthetic::SyntheticPerson;

/// Frames of each person's film: a step sees one, so that more would only take time to make.
const FRAMES: usize = 6;
/// The spans that follow each other in a step; all others lie inside them.
const STAGES: [&str; 8] = [
    "draw",
    "pose",
    "march",
    "fields",
    "composite",
    "backward",
    "guard",
    "update",
];

/// What to measure.
#[derive(Clone, Debug)]
pub struct BenchOptions {
    /// What is timed.
    pub what: Timed,
    /// People in the model.
    pub people: usize,
    /// Side of their pictures, pixels.
    pub size: u32,
    /// Steps taken before the clock starts: caches fill, and what is learned of empty space
    /// takes effect.
    pub settle: u64,
    /// Steps that are timed.
    pub steps: u64,
    /// Whether to render a frame with what was trained, too.
    pub frame: bool,
    /// Whether to measure networks with bf16 factors, too.
    pub bf16: bool,
    /// Seed of people, weights and draws.
    pub seed: u64,
    /// In place of the tier's.
    pub settings: Vec<Setting>,
    /// Weights of the networks of LPIPS; without them LPIPS is not minimised.
    pub lpips: Option<LpipsWeights>,
}

/// The step that is timed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Timed {
    /// A quality tier's.
    Tier(String),
    /// A form of the paper's.
    Form(StepForm),
}

/// One precision's figures.
#[derive(Clone, Debug, Serialize)]
pub struct StepTimes {
    /// Mean seconds of a step.
    pub step_seconds: f64,
    /// Mean seconds of each stage; `other` is what no stage covers.
    pub stages: BTreeMap<String, f64>,
    /// Of these, mean seconds in single operations, which lie inside the stages.
    pub operations: BTreeMap<String, f64>,
    /// Most memory held while stepping, bytes; absent where the system does not tell.
    pub peak_bytes: Option<u64>,
    /// Mean samples a step that the networks saw.
    pub live_samples: f64,
    /// Samples a step that rays placed.
    pub samples: u64,
    /// Seconds of one frame from a held-out camera, when asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame_seconds: Option<f64>,
}

/// The whole measurement.
#[derive(Clone, Debug, Serialize)]
pub struct BenchReport {
    /// Quality tier.
    pub tier: String,
    /// Form of the paper's step, when one was timed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub form: Option<&'static str>,
    /// Numbers that are learned.
    pub parameters: u64,
    /// What the loss is made of.
    pub objective: String,
    /// Steps taken before the clock started.
    pub settle: u64,
    /// Steps that were timed.
    pub steps: u64,
    /// Single precision.
    pub f32: StepTimes,
    /// Networks with bf16 factors, when asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bf16: Option<StepTimes>,
    /// Most memory of all, bytes.
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
    config.schedule = config.schedule.all_at_once();
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

/// A frame of the first of the cast, in the first pose that was filmed. The second of two, so
/// that memory has been asked for once.
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

fn people(cast: &[SyntheticPerson], size: u32) -> anyhow::Result<Vec<Person>> {
    cast.iter()
        .enumerate()
        .map(|(slot, person)| {
            let (track, film) = person.capture(FRAMES, size);
            let mut builder = ShardBuilder::new(track);
            for image in &film {
                builder.push(image)?;
            }
            let shard = Arc::new(builder.finish().context("packing a made-up capture")?);
            Ok(Person {
                slot,
                name: person.name().to_owned(),
                shard,
            })
        })
        .collect()
}

fn training(options: &BenchOptions) -> TrainOptions {
    TrainOptions {
        budget: Budget::Steps(options.settle + options.steps),
        used_seconds: 0.0,
        used_steps: 0,
        seed: options.seed,
        image_size: 0,
        holdout_every: 0,
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
