//! A training of splats on a film, from the first picture to the comparison at the end.

use super::{DistillError, Lessons};
use crate::config::ModelConfig;
use crate::train::{Budget, Person, TrainError, TrainOptions, TrainProgress, Trainer, Validation};
use burn::tensor::Device;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The share of the time in which the field is rendered.
const RENDERING: f64 = 1.0 / 3.0;
/// Every so many pictures, one is held out, for the comparison at the end.
const HELD_OUT: usize = 10;
/// Fewest pictures, whatever the time.
const FEWEST: usize = 12;

/// How splats learn.
#[derive(Clone, Debug)]
pub struct Course {
    /// Name of the person.
    pub name: String,
    /// Seconds of rendering and training together; the first picture and a second of training are always
    /// done.
    pub seconds: f64,
    /// Seed of the training.
    pub seed: u64,
    /// The folder for the film, in a file without a name; `None`: it is in memory.
    pub scratch: Option<PathBuf>,
}

/// Where a course is.
#[derive(Clone, Debug)]
pub enum Stage {
    /// So many pictures are rendered.
    Filming(usize),
    /// The splats learn from them.
    Training(Box<TrainProgress>),
}

/// Splats that know a person.
pub struct Distilled {
    /// A model with the person in slot 0, compared with the film.
    pub trainer: Trainer,
    /// Number of pictures that the field rendered, and those that were filmed before.
    pub pictures: usize,
    /// Time that it took.
    pub time: Duration,
}

impl Course {
    /// Makes splats by `lessons` on `device`. `tell` gets each stage and the share of the whole that is done, 0 to 1;
    /// it ends early unless it `goes_on`.
    ///
    /// # Errors
    /// If there is nobody or no pose, a picture can't be rendered, or the training fails;
    /// [`DistillError::Stopped`].
    pub fn run(
        &self,
        lessons: &Lessons<'_>,
        device: &Device,
        tell: &mut dyn FnMut(Stage, f64),
        goes_on: &mut dyn FnMut() -> bool,
    ) -> Result<Distilled, DistillError> {
        let began = Instant::now();
        let fraction = || (began.elapsed().as_secs_f64() / self.seconds).min(1.0);
        let limit = RENDERING * self.seconds;
        let wanted = |pictures: usize| {
            tell(Stage::Filming(pictures), fraction());
            pictures < FEWEST || began.elapsed().as_secs_f64() < limit
        };
        let film = lessons.film_while(wanted, goes_on)?;
        let pictures = film.frames();
        let options = TrainOptions {
            budget: Budget::Seconds((self.seconds - began.elapsed().as_secs_f64()).max(1.0)),
            seed: self.seed,
            image_size: lessons.size[0].max(lessons.size[1]),
            validation: Validation::Every(HELD_OUT),
            scratch: self.scratch.clone(),
            ..TrainOptions::default()
        };
        let person = Person {
            slot: 0,
            name: self.name.clone(),
            shard: Arc::new(film),
        };
        let config = ModelConfig::named("splat", "yoto")?;
        let mut trainer = Trainer::new(config, options, vec![person], device)
            .map_err(failed("starting the training"))?;
        while !trainer.finished() {
            if !goes_on() {
                return Err(DistillError::Stopped);
            }
            trainer.step().map_err(failed("a training step"))?;
            tell(Stage::Training(Box::new(trainer.progress())), fraction());
        }
        trainer
            .validate_with(&mut || {
                // The comparison takes less than a second.
                goes_on();
            })
            .map_err(failed("the comparison with the field"))?;
        Ok(Distilled {
            trainer,
            pictures,
            time: began.elapsed(),
        })
    }
}

fn failed(doing: &'static str) -> impl Fn(TrainError) -> DistillError {
    move |source| DistillError::Train { doing, source }
}
