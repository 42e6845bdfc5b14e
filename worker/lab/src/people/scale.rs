//! Models of more and more people at equal steps per person: what a step and a checkpoint cost, and how good
//! everybody is.

use super::{CAST_SEED, scores, sheet};
use crate::captures::Recording;
use crate::cast;
use crate::display::Screen;
use crate::memory;
use crate::report::{SplitScores, SubjectScore};
use crate::training::{self, checkpoint_bytes, pick_device, to_the_end};
use anyhow::Context;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use yoto_avatar::config::{ModelConfig, Setting};
use yoto_avatar::train::{Budget, TrainOptions, Trainer};
use yoto_device::PickedDevice;

/// The file with the figures.
pub const FILE: &str = "scale.json";

/// Settings of the experiment.
#[derive(Debug, Clone)]
pub struct ScaleOptions {
    /// Numbers of people.
    pub people: Vec<usize>,
    /// Quality tier.
    pub tier: String,
    /// Settings in place of the tier's.
    pub settings: Vec<Setting>,
    /// Side of the pictures, pixels.
    pub size: u32,
    /// Frames of the people's films, in turn.
    pub frames: Vec<usize>,
    /// Steps for each person.
    pub steps: u64,
    /// Whether everybody is also trained in a model of their own.
    pub separate: bool,
    /// Held-out pictures of each kind and person that are measured.
    pub pictures: usize,
    /// Random seed of the training.
    pub seed: u64,
    /// Folder for the figures and a sheet of everybody.
    pub out: PathBuf,
}

/// A model of some people.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// People in the model.
    pub people: usize,
    /// Steps of the training.
    pub steps: u64,
    /// Mean milliseconds of a step.
    pub step_ms: f64,
    /// Largest memory of the process during the training, bytes, with everybody's films; `None` if the
    /// system does not tell it.
    pub peak_bytes: Option<u64>,
    /// Size of the checkpoint, bytes, with the optimiser's moments.
    pub checkpoint_bytes: u64,
    /// Number of parameters.
    pub parameters: u64,
    /// Figures of each person.
    pub subjects: Vec<SubjectScore>,
    /// Means over the people.
    pub mean: SplitScores,
    /// Figures of each person in a model of their own, with as many steps; empty if there are none.
    #[serde(default)]
    pub alone: Vec<SubjectScore>,
}

impl Row {
    /// Means over the people in models of their own, if there are any.
    pub fn mean_alone(&self) -> Option<SplitScores> {
        (!self.alone.is_empty()).then(|| SplitScores::mean(&self.alone))
    }

    /// Mean PSNR of the person who has the lowest, views and poses, dB.
    pub fn worst(&self) -> (f64, f64) {
        let lowest = |of: fn(&SplitScores) -> f64| {
            let each = self.subjects.iter().map(|it| of(&it.scores));
            each.fold(f64::INFINITY, f64::min)
        };
        (
            lowest(|it| it.novel_view.psnr),
            lowest(|it| it.novel_pose.psnr),
        )
    }
}

/// Trains and measures a model of each number of people, and writes the figures and a sheet of pictures.
///
/// # Errors
/// An unknown tier, training that diverges, a file that can't be written.
pub fn run(
    options: &ScaleOptions,
    screen: &dyn Screen,
    mut on_row: impl FnMut(&Row),
) -> anyhow::Result<Vec<Row>> {
    let config = ModelConfig::named(&options.tier, "yoto")?.with(&options.settings)?;
    let picked = pick_device(screen);
    std::fs::create_dir_all(&options.out)
        .with_context(|| format!("making the folder {}", options.out.display()))?;
    let mut rows = Vec::new();
    for &count in &options.people {
        let recordings = cast::varied(count, &options.frames, options.size, CAST_SEED)?;
        let lesson = Lesson {
            options,
            config: &config,
            picked: &picked,
            screen,
        };
        // Without the count, only the peak is unknown.
        let is_counted = memory::reset_peak().is_ok();
        let trainer = lesson.train(&recordings)?;
        let peak_bytes = memory::peak().filter(|_| is_counted);
        let subjects = lesson.measure(&trainer, &recordings)?;
        let sheet = options.out.join(format!("people-{count}.png"));
        sheet::write(&sheet, &trainer.renderer(), &recordings)?;
        let progress = trainer.progress();
        let checkpoint_bytes = checkpoint_bytes(&trainer)?;
        let parameters = trainer.parameters();
        drop(trainer);
        let mut alone = Vec::new();
        if options.separate {
            for recording in recordings.chunks(1) {
                alone.extend(lesson.measure(&lesson.train(recording)?, recording)?);
            }
        }
        let row = Row {
            people: count,
            steps: progress.step,
            step_ms: 1e3 * progress.train_seconds / progress.step.max(1) as f64,
            peak_bytes,
            checkpoint_bytes,
            parameters,
            mean: SplitScores::mean(&subjects),
            subjects,
            alone,
        };
        on_row(&row);
        rows.push(row);
        let path = options.out.join(FILE);
        let json = serde_json::to_vec_pretty(&rows)?;
        std::fs::write(&path, json).with_context(|| format!("writing {}", path.display()))?;
    }
    Ok(rows)
}

/// How all models are trained and measured.
struct Lesson<'a> {
    options: &'a ScaleOptions,
    config: &'a ModelConfig,
    picked: &'a PickedDevice,
    screen: &'a dyn Screen,
}

impl Lesson<'_> {
    /// A model of everybody in `recordings`, after the same number of steps for each.
    fn train(&self, recordings: &[Recording]) -> anyhow::Result<Trainer> {
        let options = self.options;
        let people = recordings.iter().enumerate();
        let people = people.map(|(slot, recording)| recording.person(slot));
        let budget = Budget::Steps(options.steps * recordings.len() as u64);
        let train_options = TrainOptions {
            scratch: Some(options.out.clone()),
            ..training::options(budget, options.size, options.seed, None)
        };
        let (config, people) = (self.config.clone(), people.collect());
        let mut trainer = Trainer::new(config, train_options, people, &self.picked.device)?;
        let mut display = self.screen.begin(&format!("{} people", recordings.len()));
        to_the_end(&mut trainer, display.as_mut())?;
        display.finish(&format!("{} steps", trainer.progress().step));
        Ok(trainer)
    }

    /// Figures of everybody in `recordings`.
    fn measure(
        &self,
        trainer: &Trainer,
        recordings: &[Recording],
    ) -> anyhow::Result<Vec<SubjectScore>> {
        scores(trainer, recordings, self.options.pictures, self.screen)
    }
}
