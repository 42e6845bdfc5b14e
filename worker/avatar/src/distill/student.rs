//! The training of splats, the student, on a teacher's pictures, from the first picture to the comparison at the end.

use super::{DistillError, Teacher};
use crate::config::{LearnExposure, ModelConfig, Refine};
use crate::train::{
    Budget, TrainError, TrainOptions, TrainPerson, TrainProgress, Trainer, Validation,
};
use burn::tensor::Device;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The share of the time in which the field is rendered.
const RENDERING: f64 = 1.0 / 3.0;
/// One in this many pictures of the field is held out for the comparison at the end.
const HELD_OUT: usize = 10;
/// Fewest pictures of the field, whatever the time.
pub const FEWEST: usize = 12;

/// Settings of the splats' training.
#[derive(Clone, Debug)]
pub struct StudentTraining {
    /// Name of the person.
    pub name: String,
    /// Seconds: a third of rendering, or more of a field that is slow, until there are [`FEWEST`] pictures; and two thirds
    /// of training.
    pub seconds: f64,
    /// Seed of the training.
    pub seed: u64,
    /// The folder for the pictures, in a file without a name; `None`: they are in memory.
    pub scratch: Option<PathBuf>,
}

/// The stage of a distillation.
#[derive(Clone, Debug)]
pub enum DistillStage {
    /// It renders the teacher's pictures; so far, this number.
    Rendering(usize),
    /// It trains the splats on them.
    Training(Box<TrainProgress>),
}

/// Splats that have learned a person.
pub struct Distilled {
    /// A model with the person in slot 0, compared with the teacher's pictures.
    pub trainer: Trainer,
    /// Number of pictures that the field rendered, plus the frames of the capture.
    pub pictures: usize,
    /// Time that it took.
    pub time: Duration,
}

impl StudentTraining {
    /// Trains splats on the pictures of `teacher` on `device`. `tell` gets each stage and the share of the whole that is
    /// done, 0 to 1. The training ends early when `keep_going` returns false.
    ///
    /// # Errors
    /// Without a person or a pose, if a picture can't be rendered, or if the training fails;
    /// [`DistillError::Stopped`].
    pub fn run(
        &self,
        teacher: &Teacher<'_>,
        device: &Device,
        tell: &mut dyn FnMut(DistillStage, f64),
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Result<Distilled, DistillError> {
        let began = Instant::now();
        let limit = RENDERING * self.seconds;
        let wanted = |pictures: usize| {
            let spent = began.elapsed().as_secs_f64();
            let done = (spent / limit).min(pictures as f64 / FEWEST as f64);
            tell(DistillStage::Rendering(pictures), RENDERING * done.min(1.0));
            pictures < FEWEST || spent < limit
        };
        let shard = teacher.render_shard(wanted, keep_going)?;
        let pictures = shard.frames();
        let rendered = pictures - teacher.capture_frames.len();
        let budget = (1.0 - RENDERING) * self.seconds;
        let options = TrainOptions {
            budget: Budget::Seconds(budget),
            seed: self.seed,
            image_size: teacher.size[0].max(teacher.size[1]),
            validation: held_out(rendered),
            scratch: self.scratch.clone(),
            // The field was rendered in exactly these poses, and those of frames are as its training left
            // them.
            refine_poses: Some(Refine::Never),
            // The field's pictures are exposed alike; a camera may have adjusted itself.
            exposure: teacher
                .capture_frames
                .is_empty()
                .then_some(LearnExposure::Never),
            ..TrainOptions::default()
        };
        let person = TrainPerson {
            slot: 0,
            name: self.name.clone(),
            shard: Arc::new(shard),
        };
        let config = ModelConfig::named("splat", "yoto")?;
        let mut trainer = Trainer::new(config, options, vec![person], device)
            .map_err(failed("starting the training"))?;
        while !trainer.finished() {
            if !keep_going() {
                return Err(DistillError::Stopped);
            }
            trainer.step().map_err(failed("a training step"))?;
            let progress = trainer.progress();
            let done = (progress.train_seconds / budget).min(1.0);
            let done = RENDERING + (1.0 - RENDERING) * done;
            tell(DistillStage::Training(Box::new(progress)), done);
        }
        trainer
            .validate_with(&mut || {
                // The comparison takes less than a second.
                keep_going();
            })
            .map_err(failed("the comparison with the field"))?;
        Ok(Distilled {
            trainer,
            pictures,
            time: began.elapsed(),
        })
    }
}

/// Some of the pictures that the field `rendered`; frames of a capture are for training.
fn held_out(rendered: usize) -> Validation {
    let every = Validation::Every(HELD_OUT);
    let pictures = (0..rendered).filter(|index| every.holds_out(*index, 0));
    Validation::Frames(pictures.map(|index| index as u32).collect())
}

fn failed(doing: &'static str) -> impl Fn(TrainError) -> DistillError {
    move |source| DistillError::Train { doing, source }
}
