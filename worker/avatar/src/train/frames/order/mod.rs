//! The person and the frame that each step learns from.

mod by_frame;
mod by_person;
mod steps_per_person;

pub(crate) use steps_per_person::PersonSteps;

use crate::config::{SamplingConfig, SamplingStrategy};
use by_frame::ByFrame;
use by_person::ByPerson;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// A frame of a person, as indices into the trainer's lists.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct FrameIndex {
    pub subject: usize,
    pub frame: usize,
}

/// The order of steps. It depends only on the seed, the number of the step, and what checkpoints keep of
/// earlier steps, so that a resumed training has the same order as an uninterrupted one.
pub(crate) enum FrameOrder {
    ByFrame(ByFrame),
    ByPerson(ByPerson),
}

impl FrameOrder {
    /// The order for subjects with `counts[i]` frames, at least one each.
    pub(crate) fn new(sampling: SamplingConfig, seed: u64, counts: &[usize]) -> Self {
        match sampling.strategy {
            SamplingStrategy::Frame => Self::ByFrame(ByFrame::new(seed, counts)),
            SamplingStrategy::Person => Self::ByPerson(ByPerson::new(seed, counts)),
        }
    }

    /// The frame of a step. `steps_per_person` has what is known of earlier steps with each subject.
    ///
    /// # Panics
    /// If there are no subjects, or `steps_per_person` has another number of them.
    pub(crate) fn at(&mut self, step: u64, steps_per_person: &[PersonSteps]) -> FrameIndex {
        match self {
            Self::ByFrame(order) => order.at(step),
            Self::ByPerson(order) => order.at(step, steps_per_person),
        }
    }
}

/// The random generator of one of several independent series of draws.
fn series(seed: u64, series: u64, number: u64) -> ChaCha8Rng {
    let mut key = [0; 32];
    key[..8].copy_from_slice(&seed.to_le_bytes());
    key[8..16].copy_from_slice(&series.to_le_bytes());
    let mut rng = ChaCha8Rng::from_seed(key);
    rng.set_stream(number);
    rng
}
