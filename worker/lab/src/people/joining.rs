//! Somebody joins a model that others have trained: how long it takes, how near it comes to a joint training,
//! and whether anything of the others changes.

use super::People;
use crate::captures::{Recording, Split};
use crate::display::Screen;
use crate::measure;
use crate::report::SplitScores;
use crate::training::{self, pick_device, to_the_end};
use anyhow::{Context, ensure};
use safetensors::SafeTensors;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::path::Path;
use yoto_avatar::config::{ModelConfig, Setting};
use yoto_avatar::evaluate::{Examiner, Protocol};
use yoto_avatar::render::RenderView;
use yoto_avatar::train::{Budget, Learn, TrainOptions, Trainer};
use yoto_proto::manifest::files;
use yoto_proto::protocols::HELD_OUT;

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
    /// Steps and seconds of the others' training.
    pub before: Spent,
    /// Steps and seconds of the one who joins.
    pub joining: Spent,
    /// Figures of the one who joined.
    pub joined: SplitScores,
    /// Steps and seconds of a training of everybody from the start, with as many steps on the same person.
    pub together: Spent,
    /// Figures of the same person in it.
    pub jointly: SplitScores,
    /// Whether weights and renders of the others are those of before, bit for bit.
    pub others_equal: bool,
    /// Hash of the others' weights and renders before.
    pub others_before: String,
    /// Hash of the same afterwards.
    pub others_after: String,
}

/// What a training took.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Spent {
    /// Steps.
    pub steps: u64,
    /// Seconds spent in them.
    pub seconds: f64,
}

/// Trains the others, lets the last person join, trains all together, and compares.
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

    let steps = Budget::Steps(options.steps * slot as u64);
    let others = (0..slot).map(person).collect();
    let mut trainer = Trainer::new(config.clone(), plain(steps), others, &device)?;
    let before = train("the others", &mut trainer)?;
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
    let joined = scores(&trainer, slot, &recordings[slot], options, screen)?;
    trainer.save(folder.path())?;
    let others_after = others_hash(
        &trainer,
        folder.path(),
        &recordings[..slot],
        options,
        Some(&known),
    )?;
    drop(trainer);

    // An epoch has every frame of everybody once.
    let frames = |it: &Recording| it.shard.track.frames.len() as u64;
    let all: u64 = recordings.iter().map(frames).sum();
    let steps = (joining.steps * all).div_ceil(frames(&recordings[slot]));
    let everybody = (0..=slot).map(person).collect();
    let mut trainer = Trainer::new(config, plain(Budget::Steps(steps)), everybody, &device)?;
    let together = train("everybody together", &mut trainer)?;
    let jointly = scores(&trainer, slot, &recordings[slot], options, screen)?;
    Ok(Joining {
        tier: options.tier.clone(),
        size: options.size,
        name: recordings[slot].name.clone(),
        others: recordings[..slot]
            .iter()
            .map(|it| it.name.clone())
            .collect(),
        before,
        joining,
        joined,
        together,
        jointly,
        others_equal: others_before == others_after,
        others_before,
        others_after,
    })
}

fn scores(
    trainer: &Trainer,
    slot: usize,
    recording: &Recording,
    options: &JoiningOptions,
    screen: &dyn Screen,
) -> anyhow::Result<SplitScores> {
    let examiner = Examiner::new(trainer.renderer(), Protocol::named(HELD_OUT)?, None);
    let mut display = screen.begin("evaluating");
    let pictures = options.pictures;
    let score = measure::subject(&examiner, slot, recording, pictures, display.as_mut())?;
    display.finish(&recording.name);
    Ok(score.scores)
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
