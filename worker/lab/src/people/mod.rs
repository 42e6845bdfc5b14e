//! Experiments on many people in one model: what a further person costs, how well somebody joins, and what
//! a trained trunk is worth to people whom it never saw.

pub mod joining;
pub mod prior;
pub mod scale;
mod sheet;

use crate::captures::{self, Recording};
use crate::cast;
use crate::display::Screen;
use crate::measure;
use crate::report::SubjectScore;
use std::path::PathBuf;
use yoto_avatar::evaluate::{Examiner, Protocol};
use yoto_avatar::train::Trainer;
use yoto_proto::protocols::HELD_OUT;

/// Seed of made-up people: seeds of a training tell its chance alone.
const CAST_SEED: u64 = 7;

/// Whom an experiment is about.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum People {
    /// Capture folders, one per person.
    Captures(Vec<PathBuf>),
    /// So many made-up people, all of another build, in other clothes that move with the pose.
    Synthetic(usize),
}

impl People {
    /// Their films and held-out pictures of `size` pixels.
    fn record(&self, size: u32, screen: &dyn Screen) -> anyhow::Result<Vec<Recording>> {
        match self {
            Self::Captures(folders) => {
                let protocol = Protocol::named(HELD_OUT)?;
                captures::read_all(folders, size, protocol, screen)
            }
            Self::Synthetic(count) => cast::varied(*count, &[cast::FRAMES], size, CAST_SEED),
        }
    }
}

/// Figures of everybody in `recordings`, who are in the first slots.
fn scores(
    trainer: &Trainer,
    recordings: &[Recording],
    pictures: usize,
    screen: &dyn Screen,
) -> anyhow::Result<Vec<SubjectScore>> {
    let examiner = Examiner::new(trainer.renderer(), Protocol::named(HELD_OUT)?, None);
    let mut display = screen.begin("evaluating");
    let score = |(slot, recording)| {
        measure::subject(&examiner, slot, recording, pictures, display.as_mut())
    };
    let scores: Vec<_> = recordings
        .iter()
        .enumerate()
        .map(score)
        .collect::<anyhow::Result<_>>()?;
    display.finish(&format!("{} people", scores.len()));
    Ok(scores)
}
