//! Somebody joins a model that others have trained: how long it takes, how near it comes to a joint training,
//! and whether anything of the others changes.

use super::{People, scores};
use crate::captures::{Recording, Split};
use crate::display::Screen;
use crate::report::{SplitScores, SubjectScore};
use crate::training::{self, pick_device, to_the_end};
use anyhow::{Context, ensure};
use safetensors::SafeTensors;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::path::Path;
use yoto_avatar::config::{ModelConfig, Setting, Turns};
use yoto_avatar::render::RenderView;
use yoto_avatar::train::{Budget, Learn, TrainOptions, Trainer};
use yoto_proto::manifest::files;

/// Settings of the experiment.
#[derive(Debug, Clone)]
pub struct JoiningOptions {
    /// Everybody; the last one joins the others.
    pub people: People,
    /// Quality tier.
    pub tier: String,
    /// Settings in place of the tier's.
    pub settings: Vec<Setting>,
    /// Longest side of the pictures, pixels.
    pub size: u32,
    /// Steps of the others' training, for each of them.
    pub steps: u64,
    /// Budget of the one who joins.
    pub budget: Budget,
    /// Steps of everybody, for each of them, in the model that somebody joined; 0: none.
    pub refine: u64,
    /// Held-out pictures of each kind that are measured.
    pub pictures: usize,
    /// Random seed.
    pub seed: u64,
}

/// What was found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Joining {
    /// Quality tier.
    pub tier: String,
    /// Longest side of the pictures, pixels.
    pub size: u32,
    /// Who joins.
    pub name: String,
    /// Who is there.
    pub others: Vec<String>,
    /// The trainings, in their order; the last one is of everybody from the start, with as many steps on the
    /// one who joined.
    pub stages: Vec<Stage>,
    /// Whether weights and renders of the others are those of before, bit for bit, once somebody joined.
    pub others_equal: bool,
    /// Hash of the others' weights and renders before.
    pub others_before: String,
    /// Hash of the same afterwards.
    pub others_after: String,
}

/// A training, and everybody's figures after it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Stage {
    /// What was trained.
    pub name: String,
    /// Steps and seconds.
    pub spent: Spent,
    /// Figures of everybody whom the model knows, the one who joins last.
    pub people: Vec<SubjectScore>,
}

impl Stage {
    /// Figures of the one who joins, in a model of `others` more people.
    pub fn joined(&self, others: usize) -> Option<SplitScores> {
        self.people.get(others).map(|score| score.scores)
    }

    /// Means over the `others`.
    pub fn others(&self, others: usize) -> SplitScores {
        SplitScores::mean(&self.people[..others.min(self.people.len())])
    }
}

/// What a training took.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Spent {
    /// Steps.
    pub steps: u64,
    /// Seconds spent in them.
    pub seconds: f64,
}

/// Trains the others, lets the last person join, refines everybody, trains all together, and compares.
///
/// # Errors
/// Fewer than two people, a capture that can't be read, training that diverges.
pub fn run(options: &JoiningOptions, screen: &dyn Screen) -> anyhow::Result<Joining> {
    let config = ModelConfig::named(&options.tier, "yoto")?.with(&options.settings)?;
    let recordings = options.people.record(options.size, screen)?;
    ensure!(
        recordings.len() > 1,
        "somebody joins others: at least two people are needed"
    );
    let slot = recordings.len() - 1;
    let device = pick_device(screen).device;
    let person = |slot: usize| recordings[slot].person(slot);
    let plain = |budget| training::options(budget, options.size, options.seed, None);
    let folder = tempfile::tempdir().context("making a temporary folder")?;
    let train = |label: &str, trainer: &mut Trainer| -> anyhow::Result<Spent> {
        let mut display = screen.begin(label);
        let before = trainer.progress();
        to_the_end(trainer, display.as_mut())?;
        let after = trainer.progress();
        let spent = Spent {
            steps: after.step - before.step,
            seconds: after.train_seconds - before.train_seconds,
        };
        display.finish(&format!("{} steps in {:.1} s", spent.steps, spent.seconds));
        Ok(spent)
    };

    let stage = |name: &str, spent: Spent, trainer: &Trainer, people: usize| {
        let people = scores(trainer, &recordings[..people], options.pictures, screen)?;
        let name = name.to_owned();
        anyhow::Ok(Stage {
            name,
            spent,
            people,
        })
    };
    let everybody = || (0..=slot).map(person).collect::<Vec<_>>();

    let steps = Budget::Steps(options.steps * slot as u64);
    let others = (0..slot).map(person).collect();
    let mut trainer = Trainer::new(config.clone(), plain(steps), others, &device)?;
    let spent = train("the others", &mut trainer)?;
    let mut stages = vec![stage("before", spent, &trainer, slot)?];
    trainer.save(folder.path())?;
    let others_before = others_hash(&trainer, folder.path(), &recordings[..slot], options, None)?;
    let known = tensor_names(folder.path())?;
    drop(trainer);

    let alone = TrainOptions {
        learn: Learn::Own { slot },
        ..plain(options.budget)
    };
    let mut trainer = Trainer::resume(folder.path(), alone, vec![person(slot)], &device)?;
    let joining = train("joining", &mut trainer)?;
    stages.push(stage("joined", joining, &trainer, slot + 1)?);
    trainer.save(folder.path())?;
    let others_after = others_hash(
        &trainer,
        folder.path(),
        &recordings[..slot],
        options,
        Some(&known),
    )?;
    drop(trainer);

    if options.refine > 0 {
        let steps = Budget::Steps(options.refine * recordings.len() as u64);
        let mut trainer = Trainer::resume(folder.path(), plain(steps), everybody(), &device)?;
        let spent = train("refining everybody", &mut trainer)?;
        stages.push(stage("refined", spent, &trainer, slot + 1)?);
    }

    let steps = Budget::Steps(as_many(
        &config,
        joining.steps + options.refine,
        &recordings,
    ));
    let mut trainer = Trainer::new(config, plain(steps), everybody(), &device)?;
    let spent = train("everybody together", &mut trainer)?;
    stages.push(stage("together", spent, &trainer, slot + 1)?);
    Ok(Joining {
        tier: options.tier.clone(),
        size: options.size,
        name: recordings[slot].name.clone(),
        others: recordings[..slot]
            .iter()
            .map(|it| it.name.clone())
            .collect(),
        stages,
        others_equal: others_before == others_after,
        others_before,
        others_after,
    })
}

/// Steps of everybody of which the last person gets as many as `own`.
fn as_many(config: &ModelConfig, own: u64, recordings: &[Recording]) -> u64 {
    match config.sampling.turns {
        Turns::Person => own * recordings.len() as u64,
        Turns::Frame => {
            let frames = |it: &Recording| it.shard.track.frames.len() as u64;
            let all: u64 = recordings.iter().map(frames).sum();
            let last = recordings.last().map_or(1, frames);
            (own * all).div_ceil(last)
        }
    }
}

/// Hash of the tensors called `known` (all, where `None`) of the checkpoint in `dir`, and of the pictures of
/// everybody in `recordings`.
fn others_hash(
    trainer: &Trainer,
    dir: &Path,
    recordings: &[Recording],
    options: &JoiningOptions,
    known: Option<&[String]>,
) -> anyhow::Result<String> {
    let mut hash = Sha256::new();
    let bytes = std::fs::read(dir.join(files::WEIGHTS)).context("reading the weights")?;
    let tensors = SafeTensors::deserialize(&bytes).context("reading the weights")?;
    let mut names: Vec<&str> = tensors.names();
    names.sort_unstable();
    for name in names {
        if known.is_none_or(|known| known.iter().any(|it| it == name)) {
            hash.update(name);
            hash.update(tensors.tensor(name)?.data());
        }
    }
    let renderer = trainer.renderer();
    for (slot, recording) in recordings.iter().enumerate() {
        for split in [Split::NovelView, Split::NovelPose] {
            for view in recording.subset(split, options.pictures) {
                let frame = renderer.render(&RenderView {
                    slot,
                    pose: view.pose.clone(),
                    camera: view.camera.clone(),
                    background: [0.0; 3],
                })?;
                let numbers = frame.rgb.iter().chain(&frame.alpha);
                numbers.for_each(|value| hash.update(value.to_le_bytes()));
            }
        }
    }
    Ok(hash
        .finalize()
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect())
}

fn tensor_names(dir: &Path) -> anyhow::Result<Vec<String>> {
    let bytes = std::fs::read(dir.join(files::WEIGHTS)).context("reading the weights")?;
    let tensors = SafeTensors::deserialize(&bytes).context("reading the weights")?;
    Ok(tensors.names().into_iter().map(str::to_owned).collect())
}
