//! What the trunk of another model is worth as a start: the same training with it and without.

use super::People;
use crate::captures::Split;
use crate::display::Screen;
use crate::measure;
use crate::training::{self, pick_device, shown, to_the_end};
use anyhow::Context;
use serde::{Deserialize, Serialize};
use yoto_avatar::config::{ModelConfig, Setting};
use yoto_avatar::evaluate::{Examiner, Protocol};
use yoto_avatar::train::{Budget, Trainer};
use yoto_proto::protocols::HELD_OUT;

/// Measurements over a training.
const POINTS: f64 = 24.0;

/// Settings of the experiment.
#[derive(Debug, Clone)]
pub struct PriorOptions {
    /// Whom both trainings learn.
    pub people: People,
    /// Made-up people of whom the trunk is learned.
    pub prior_people: usize,
    /// Steps of that training, for each of them.
    pub prior_steps: u64,
    /// Quality tier.
    pub tier: String,
    /// Settings in place of the tier's.
    pub settings: Vec<Setting>,
    /// Longest side of the pictures, pixels.
    pub size: u32,
    /// Length of both trainings.
    pub budget: Budget,
    /// Held-out pictures of each kind and person for each point of the curves.
    pub pictures: usize,
    /// Random seed.
    pub seed: u64,
}

/// Quality at some time of a training.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Steps so far.
    pub steps: u64,
    /// Seconds of them.
    pub seconds: f64,
    /// PSNR of held-out views, dB.
    pub views: f64,
    /// PSNR of held-out poses, dB.
    pub poses: f64,
}

/// Quality over a training.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Start {
    /// At times that follow each other.
    pub points: Vec<Point>,
}

impl Start {
    /// The first point at which held-out views have `target` dB; `None` if they never do.
    pub fn reached(&self, target: f64) -> Option<&Point> {
        self.points.iter().find(|point| point.views >= target)
    }
}

/// The same training with the start that a model has by itself, and with the trunk of another.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Prior {
    /// Seconds of the trunk's own training.
    pub prior_seconds: f64,
    /// Without it.
    pub without: Start,
    /// With it.
    pub with: Start,
}

/// Learns a trunk of made-up people, and trains others with it and without.
///
/// # Errors
/// An unknown tier, a capture that can't be read, training that diverges.
pub fn run(options: &PriorOptions, screen: &dyn Screen) -> anyhow::Result<Prior> {
    let config = ModelConfig::named(&options.tier, "yoto")?.with(&options.settings)?;
    let device = pick_device(screen).device;
    let folder = tempfile::tempdir().context("making a temporary folder")?;
    let strangers = People::Synthetic(options.prior_people).record(options.size, screen)?;
    let strangers: Vec<_> = (strangers.iter().enumerate())
        .map(|(slot, recording)| recording.person(slot))
        .collect();
    let budget = Budget::Steps(options.prior_steps * strangers.len() as u64);
    let plain = |budget| training::options(budget, options.size, options.seed, None);
    let mut trainer = Trainer::new(config.clone(), plain(budget), strangers, &device)?;
    let mut display = screen.begin("the trunk");
    to_the_end(&mut trainer, display.as_mut())?;
    let prior_seconds = trainer.progress().train_seconds;
    display.finish(&format!("{prior_seconds:.0} s"));
    trainer.save(folder.path())?;
    drop(trainer);

    let recordings = options.people.record(options.size, screen)?;
    let start = |trunk: bool| -> anyhow::Result<Start> {
        let people = recordings.iter().enumerate();
        let people = people.map(|(slot, recording)| recording.person(slot));
        let budget = plain(options.budget);
        let mut trainer = Trainer::new(config.clone(), budget, people.collect(), &device)?;
        if trunk {
            trainer = trainer.with_trunk_of(folder.path())?;
        }
        let mut display = screen.begin(if trunk { "with it" } else { "without it" });
        let mut start = Start::default();
        while !trainer.finished() {
            trainer.step().context("a training step")?;
            let progress = trainer.progress();
            let due = (start.points.len() + 1) as f64 / POINTS;
            if progress.fraction < due {
                continue;
            }
            let protocol = Protocol::named(HELD_OUT)?;
            let examiner = Examiner::new(trainer.renderer(), protocol, None);
            let score = |split| measure::subset(&examiner, &recordings, split, options.pictures);
            let (views, poses) = (score(Split::NovelView)?.psnr, score(Split::NovelPose)?.psnr);
            start.points.push(Point {
                steps: progress.step,
                seconds: progress.train_seconds,
                views,
                poses,
            });
            display.progress(&shown(&progress, "training", Some(views)));
        }
        display.finish(&format!("{} steps", trainer.progress().step));
        Ok(start)
    };
    Ok(Prior {
        prior_seconds,
        without: start(false)?,
        with: start(true)?,
    })
}
