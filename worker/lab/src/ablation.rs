//! The paper's ablation on given captures: its four variants, trained on the same frames
//! with the same seed and budget, and measured on the same held-out pictures.
//!
//! `humannerf` knows one person per model, so it trains as many models as there are captures.
//! The budget is divided among them: each variant gets the same training in total, which is
//! a fair comparison for a given machine and time.

use crate::captures::{self, Recording};
use crate::displacement::{self, DisplacementError};
use crate::display::Screen;
use crate::training::{self, lpips, pick_device};
use crate::{cast, measure};
use anyhow::{Context, ensure};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use yoto_avatar::config::{ModelConfig, Setting, Variant};
use yoto_avatar::evaluate::{Examiner, Protocol, SplitScores, SubjectScore};
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_avatar::train::{Budget, Trainer};
use yoto_device::PickedDevice;
use yoto_proto::protocols::HELD_OUT;
use yoto_proto::tiers::VARIANTS;

/// Seed of the synthetic people.
const CAST_SEED: u64 = 7;
/// The file with all figures of an ablation.
pub const FILE: &str = "ablation.json";

/// Settings of an ablation.
#[derive(Debug, Clone)]
pub struct AblationOptions {
    /// The people to train on.
    pub people: People,
    /// Longest side of the pictures, pixels.
    pub size: u32,
    /// Budget of each variant, over all of its models.
    pub budget: Budget,
    /// Quality tier.
    pub tier: String,
    /// Random seed.
    pub seed: u64,
    /// At most this many held-out pictures of each kind and person are measured.
    pub pictures: usize,
    /// Whether each held-out picture is written beside its render and a map of their difference.
    pub pairs: bool,
    /// Folder for `ablation.json`, the models and the pairs.
    pub out: PathBuf,
    /// Variants in place of all; each is named in [`VARIANTS`].
    pub variants: Vec<String>,
    /// Settings in place of the tier's.
    pub settings: Vec<Setting>,
    /// Weights of the networks of LPIPS; without them LPIPS is neither measured nor minimised.
    pub lpips: Option<LpipsWeights>,
}

/// The people that an ablation trains on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum People {
    /// Capture folders, one per person.
    Captures(Vec<PathBuf>),
    /// This number of synthetic people, in clothes that move with the pose by a known rule.
    Synthetic(usize),
}

/// `ablation.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Ablation {
    /// Names of the captures.
    pub captures: Vec<String>,
    /// Quality tier.
    pub tier: String,
    /// Longest image side trained and evaluated at, pixels.
    pub size: u32,
    /// Random seed.
    pub seed: u64,
    /// Seconds of training per variant; absent when the budget is in steps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub budget_seconds: Option<f64>,
    /// Steps per variant; absent when the budget is in seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub budget_steps: Option<u64>,
    /// The device that trained.
    pub device: String,
    /// The training objective, e.g. a fallback without LPIPS weights.
    pub objective: String,
    /// The variants, in the order of the paper.
    pub variants: Vec<VariantScores>,
}

/// Results of one variant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VariantScores {
    /// Its name.
    pub variant: String,
    /// Models trained: one for all people, or one per person.
    pub models: usize,
    /// Steps over all models.
    pub steps: u64,
    /// Seconds of training over all models.
    pub train_seconds: f64,
    /// Parameters of all models.
    pub parameters: u64,
    /// Steps skipped because loss or gradients were not finite, over all models.
    pub skipped_steps: u64,
    /// One entry per person.
    pub subjects: Vec<SubjectScore>,
    /// Mean over the people, with equal weights.
    pub mean: SplitScores,
    /// Error of the learned motion of clothes, where the true motion is known.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub displacement: Option<DisplacementError>,
    /// Parts of the model that were active at the end.
    #[serde(default)]
    pub active_parts: Vec<String>,
}

/// Trains and measures all variants, and writes `ablation.json` and the models.
///
/// # Errors
/// The first failure: a capture that can't be read, an unknown tier,
/// fewer steps than models, training that diverges, a file that can't be written.
pub fn run(options: &AblationOptions, screen: &dyn Screen) -> anyhow::Result<Ablation> {
    let protocol = Protocol::named(HELD_OUT)?;
    let recordings = match &options.people {
        People::Captures(folders) => captures::read_all(folders, options.size, protocol, screen)?,
        // The same people for every seed of the training: seeds show the spread of training alone.
        People::Synthetic(count) => cast::record(*count, options.size, CAST_SEED)?,
    };
    let picked = pick_device(screen);
    let mut session = Session {
        options,
        screen,
        protocol,
        picked,
        recordings,
        objective: "",
    };
    let mut variants = Vec::new();
    let chosen =
        |name: &str| options.variants.is_empty() || options.variants.iter().any(|it| it == name);
    for (variant, _) in VARIANTS.iter().filter(|(name, _)| chosen(name)) {
        let scores = session
            .variant(variant)
            .with_context(|| format!("the variant {variant}"))?;
        variants.push(scores);
    }
    let (budget_seconds, budget_steps) = match options.budget {
        Budget::Seconds(seconds) => (Some(seconds), None),
        Budget::Steps(steps) => (None, Some(steps)),
    };
    let ablation = Ablation {
        captures: session
            .recordings
            .iter()
            .map(|it| it.name.clone())
            .collect(),
        tier: options.tier.clone(),
        size: options.size,
        seed: options.seed,
        budget_seconds,
        budget_steps,
        device: session.picked.info.adapter.clone(),
        objective: session.objective.to_owned(),
        variants,
    };
    let path = options.out.join(FILE);
    let json = serde_json::to_vec_pretty(&ablation).context("encoding the figures")?;
    std::fs::write(&path, json).with_context(|| format!("writing {}", path.display()))?;
    Ok(ablation)
}

/// State shared by all variants.
struct Session<'a> {
    options: &'a AblationOptions,
    screen: &'a dyn Screen,
    protocol: &'static Protocol,
    picked: PickedDevice,
    recordings: Vec<Recording>,
    objective: &'static str,
}

impl Session<'_> {
    fn variant(&mut self, variant: &str) -> anyhow::Result<VariantScores> {
        let config = ModelConfig::named(&self.options.tier, variant)?;
        let config = config.with(&self.options.settings)?;
        let everybody: Vec<usize> = (0..self.recordings.len()).collect();
        let groups: Vec<&[usize]> = if config.variant == Variant::HumanNerf {
            everybody.chunks(1).collect()
        } else {
            vec![&everybody]
        };
        let budgets = divided(self.options.budget, groups.len())?;
        let mut scores = VariantScores {
            variant: variant.to_owned(),
            models: groups.len(),
            steps: 0,
            train_seconds: 0.0,
            parameters: 0,
            skipped_steps: 0,
            mean: SplitScores::mean(&[]),
            subjects: Vec::new(),
            displacement: None,
            active_parts: Vec::new(),
        };
        let mut displacements = Vec::new();
        for (group, budget) in groups.into_iter().zip(budgets) {
            let folder = match group {
                [one] if scores.models > 1 => Path::new(variant).join(&self.recordings[*one].name),
                _ => PathBuf::from(variant),
            };
            let displacement = self.model(config.clone(), group, budget, &folder, &mut scores)?;
            displacements.extend(displacement);
        }
        scores.displacement = DisplacementError::mean(&displacements);
        scores.mean = SplitScores::mean(&scores.subjects);
        Ok(scores)
    }

    /// Trains one model of the people in `group`, saves it, and measures them.
    fn model(
        &mut self,
        config: ModelConfig,
        group: &[usize],
        budget: Budget,
        folder: &Path,
        scores: &mut VariantScores,
    ) -> anyhow::Result<Option<DisplacementError>> {
        let people = group.iter().enumerate();
        let people = people.map(|(slot, &index)| self.recordings[index].person(slot));
        let weights = self.options.lpips.as_ref();
        let options = training::options(budget, self.options.size, self.options.seed, weights);
        let mut trainer = Trainer::new(config, options, people.collect(), &self.picked.device)?;
        let mut display = self.screen.begin(&folder.display().to_string());
        training::train_to_the_end(&mut trainer, &mut *display)?;
        let progress = trainer.progress();
        scores.steps += progress.step;
        scores.train_seconds += progress.train_seconds;
        scores.parameters += trainer.parameters();
        scores.skipped_steps += progress.skipped_steps;
        scores.active_parts = progress.active_parts;
        self.objective = progress.objective;
        self.keep(&trainer, folder)?;
        let examiner = Examiner::new(
            trainer.renderer(),
            self.protocol,
            lpips(weights, &self.picked)?,
        );
        let pairs = self
            .options
            .pairs
            .then(|| self.options.out.join("pairs").join(folder));
        for (slot, &index) in group.iter().enumerate() {
            let recording = &self.recordings[index];
            let pictures = self.options.pictures;
            let pairs = pairs.as_deref();
            let subject =
                measure::subject(&examiner, slot, recording, pictures, pairs, &mut *display)?;
            scores.subjects.push(subject);
        }
        display.finish(&format!("{} steps", progress.step));
        let people = group
            .iter()
            .map(|&index| &self.recordings[index])
            .enumerate();
        let people: Vec<_> = people.collect();
        displacement::measure(&trainer.renderer(), &people)
    }

    fn keep(&self, trainer: &Trainer, folder: &Path) -> anyhow::Result<()> {
        let folder = self.options.out.join("models").join(folder);
        std::fs::create_dir_all(&folder).with_context(|| format!("making {}", folder.display()))?;
        trainer
            .save(&folder)
            .with_context(|| format!("saving the model in {}", folder.display()))
    }
}

/// A budget divided among `models`; the first ones get the remainder.
fn divided(budget: Budget, models: usize) -> anyhow::Result<Vec<Budget>> {
    let count = models.max(1) as u64;
    Ok(match budget {
        Budget::Seconds(seconds) => vec![Budget::Seconds(seconds / count as f64); models],
        Budget::Steps(steps) => {
            ensure!(
                steps >= count,
                "{steps} steps can't be divided among {models} models"
            );
            let share = |model| steps / count + u64::from(model < steps % count);
            (0..count).map(share).map(Budget::Steps).collect()
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_whole_budget_is_shared_out() {
        let steps = |budget, models| -> Vec<u64> {
            let shares = divided(Budget::Steps(budget), models).expect("enough");
            let step = |share| match share {
                Budget::Steps(steps) => steps,
                Budget::Seconds(_) => 0,
            };
            shares.into_iter().map(step).collect()
        };
        assert_eq!(steps(10, 1), [10]);
        assert_eq!(steps(11, 3), [4, 4, 3]);
        assert!(divided(Budget::Steps(2), 3).is_err());
        let shares = divided(Budget::Seconds(60.0), 3).expect("enough");
        assert_eq!(shares, vec![Budget::Seconds(20.0); 3]);
    }
}
