//! Models of more and more people at equal steps per person: what a step and a checkpoint cost, and how good
//! everybody is.

use super::{People, sheet};
use crate::display::Screen;
use crate::measure;
use crate::memory;
use crate::report::{SplitScores, SubjectScore};
use crate::training::{self, checkpoint_bytes, pick_device, to_the_end};
use anyhow::Context;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use yoto_avatar::config::{ModelConfig, Setting};
use yoto_avatar::evaluate::{Examiner, Protocol};
use yoto_avatar::train::{Budget, Trainer};
use yoto_proto::protocols::HELD_OUT;

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
    /// Steps for each person.
    pub steps: u64,
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
}

impl Row {
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
    let device = pick_device(screen).device;
    std::fs::create_dir_all(&options.out)
        .with_context(|| format!("making the folder {}", options.out.display()))?;
    let mut rows = Vec::new();
    for &count in &options.people {
        let recordings = People::Synthetic(count).record(options.size, screen)?;
        let people = recordings.iter().enumerate();
        let people = people.map(|(slot, recording)| recording.person(slot));
        // Without the count, only the peak is unknown.
        let is_counted = memory::reset_peak().is_ok();
        let budget = Budget::Steps(options.steps * count as u64);
        let train_options = training::options(budget, options.size, options.seed, None);
        let mut trainer = Trainer::new(config.clone(), train_options, people.collect(), &device)?;
        let mut display = screen.begin(&format!("{count} people"));
        to_the_end(&mut trainer, display.as_mut())?;
        let peak_bytes = memory::peak().filter(|_| is_counted);
        let progress = trainer.progress();
        display.finish(&format!("{} steps", progress.step));
        let protocol = Protocol::named(HELD_OUT)?;
        let examiner = Examiner::new(trainer.renderer(), protocol, None);
        let mut display = screen.begin("evaluating");
        let mut subjects = Vec::new();
        for (slot, recording) in recordings.iter().enumerate() {
            let pictures = options.pictures;
            subjects.push(measure::subject(
                &examiner,
                slot,
                recording,
                pictures,
                display.as_mut(),
            )?);
        }
        display.finish(&format!("{count} people"));
        sheet::write(
            &options.out.join(format!("people-{count}.png")),
            &trainer.renderer(),
            &recordings,
        )?;
        let row = Row {
            people: count,
            steps: progress.step,
            step_ms: 1e3 * progress.train_seconds / progress.step.max(1) as f64,
            peak_bytes,
            checkpoint_bytes: checkpoint_bytes(&trainer)?,
            parameters: trainer.parameters(),
            mean: SplitScores::mean(&subjects),
            subjects,
        };
        on_row(&row);
        rows.push(row);
        let path = options.out.join(FILE);
        let json = serde_json::to_vec_pretty(&rows)?;
        std::fs::write(&path, json).with_context(|| format!("writing {}", path.display()))?;
    }
    Ok(rows)
}
