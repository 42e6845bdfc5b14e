//! Budget and data of a training.

use crate::config::{LearnExposure, Refine};
use crate::decoder::Prior;
use crate::loss::lpips::LpipsWeights;
use crate::train::Learn;
use std::collections::BTreeSet;
use std::path::PathBuf;

/// How long to train.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Budget {
    /// Seconds spent in steps.
    Seconds(f64),
    /// Number of steps.
    Steps(u64),
}

/// The frames of each person that are not trained on, to measure on them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Validation {
    /// One frame of each run of this length, the middle one, so that a single frame is trained on; 0: none.
    Every(usize),
    /// The frames with these indices in the person's pose track.
    Frames(BTreeSet<u32>),
}

impl Validation {
    /// All frames are trained on.
    pub const NONE: Self = Self::Every(0);

    /// Whether the frame at `position` of a capture, with `index` in its pose track, is held out.
    pub fn holds_out(&self, position: usize, index: u32) -> bool {
        match self {
            Self::Every(0) => false,
            Self::Every(every) => position % every == every / 2,
            Self::Frames(frames) => frames.contains(&index),
        }
    }
}

/// How to train.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainOptions {
    /// Length, over which the learning rate decays.
    pub budget: Budget,
    /// Which parameters change.
    pub learn: Learn,
    /// Seconds of the budget that are already used.
    pub used_seconds: f64,
    /// Steps of the budget that are already used.
    pub used_steps: u64,
    /// Seed of the initial weights and of all random draws.
    pub seed: u64,
    /// Longest image side, pixels; 0 keeps the capture's.
    pub image_size: u32,
    /// The folder for films, in files without names, while they are trained on; `None`: they are in memory.
    pub scratch: Option<PathBuf>,
    /// The frames of each person that are held out.
    pub validation: Validation,
    /// Which people have their poses refined; `None`: as the configuration says.
    pub refine_poses: Option<Refine>,
    /// Which films have their exposures learned; `None`: as the configuration says.
    pub exposure: Option<LearnExposure>,
    /// Degree of the harmonics by which the colours of splats depend on the view; `None`: as the configuration says.
    pub harmonics: Option<usize>,
    /// Whether what no frame shows keeps the colours that training left there, whatever the configuration says.
    pub leave_unseen: bool,
    /// What people look like where no frame shows them.
    pub prior: Prior,
    /// Weights of the networks of LPIPS; without them the objective has none.
    pub lpips: Option<LpipsWeights>,
}

impl Default for TrainOptions {
    /// A new run of five minutes on all frames at full size.
    fn default() -> Self {
        Self {
            budget: Budget::Seconds(300.0),
            learn: Learn::Everything,
            used_seconds: 0.0,
            used_steps: 0,
            seed: 7,
            image_size: 0,
            scratch: None,
            validation: Validation::NONE,
            refine_poses: None,
            exposure: None,
            harmonics: None,
            leave_unseen: false,
            prior: Prior::People,
            lpips: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn validation_takes_the_middle_of_a_run_or_the_frames_named() {
        let held = |validation: &Validation| -> Vec<usize> {
            let indices = [10u32, 11, 12, 20, 21, 22, 23];
            let frames = indices.iter().enumerate();
            let held = frames.filter(|(position, index)| validation.holds_out(*position, **index));
            held.map(|(position, _)| position).collect()
        };
        assert!(held(&Validation::NONE).is_empty());
        assert_eq!(held(&Validation::Every(3)), [1, 4]);
        assert_eq!(held(&Validation::Frames([12, 23].into())), [2, 6]);
    }
}
