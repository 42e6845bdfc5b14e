//! Exposures of the training frames of a capture, learned as the model is.
//!
//! Each time a frame is trained on, its exposure is fitted to the difference between the frame and the
//! model's picture ([`fit`]). Their mean stays neutral, since an exposure that all frames share is the colour of the
//! person.

pub(super) mod file;
mod fit;
mod learn;

pub use file::capture_exposures;
pub(super) use learn::{apply_exposure, begin, fit_exposure, near};

use crate::config::{ExposureConfig, LearnExposure};
use crate::render::FrameExposure;
use serde::{Deserialize, Serialize};
use yoto_proto::pose_track::PoseTrack;

/// Share of the training frames that must have been fitted before a film is judged.
const JUDGED_ON: f64 = 0.8;

/// Exposures of the frames of a capture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CaptureExposures {
    /// Index of each frame of the pose track.
    indices: Vec<u32>,
    /// Exposure of each frame of the pose track; `None` until it was fitted, and for frames that are not trained on.
    frames: Vec<Option<FrameExposure>>,
    /// Whether training heeds them; `None` while that is not decided.
    heeded: Option<bool>,
}

impl CaptureExposures {
    /// The exposures of the frames of `track`, none of which is fitted.
    fn new(track: &PoseTrack, who: LearnExposure) -> Self {
        Self {
            indices: track.frames.iter().map(|frame| frame.index).collect(),
            frames: vec![None; track.frames.len()],
            heeded: (who == LearnExposure::Always).then_some(true),
        }
    }

    /// Whether they can be of the frames of `track`.
    fn is_of(&self, track: &PoseTrack) -> bool {
        let indices = track.frames.iter().map(|frame| &frame.index);
        self.indices.iter().eq(indices) && self.frames.len() == self.indices.len()
    }

    /// Whether every number is one that a fit gives.
    fn are_valid(&self) -> bool {
        let valid = |it: &FrameExposure| {
            it.gain.iter().all(|gain| gain.is_finite() && *gain > 0.0)
                && it.offset.iter().all(|offset| offset.is_finite())
        };
        self.frames.iter().flatten().all(valid)
    }

    /// The exposure that training heeds of the frame at `position`.
    fn of(&self, position: usize) -> FrameExposure {
        let own = self.frames[position].filter(|_| self.heeded == Some(true));
        own.unwrap_or(FrameExposure::NEUTRAL)
    }

    /// The exposure of a frame of the same film with this `index`, whether it is trained on or not: between those
    /// of the nearest frames before and after it that are. Neutral where none is learned.
    pub fn near(&self, index: u32) -> FrameExposure {
        if self.heeded != Some(true) {
            return FrameExposure::NEUTRAL;
        }
        let known = self.indices.iter().zip(&self.frames);
        let known = || {
            known
                .clone()
                .filter_map(|(at, frame)| Some((*at, (*frame)?)))
        };
        let before = known()
            .filter(|(at, _)| *at <= index)
            .max_by_key(|(at, _)| *at);
        let after = known()
            .filter(|(at, _)| *at >= index)
            .min_by_key(|(at, _)| *at);
        match (before, after) {
            (Some((from, a)), Some((to, b))) if to > from => {
                a.towards(&b, (index - from) as f32 / (to - from) as f32)
            }
            (Some((_, one)), _) | (None, Some((_, one))) => one,
            (None, None) => FrameExposure::NEUTRAL,
        }
    }

    /// Root mean square of the logarithms of the gains: about the relative difference of exposures.
    fn spread(&self) -> f64 {
        let known: Vec<f64> = (self.frames.iter().flatten())
            .flat_map(|it| it.gain.map(|gain| f64::from(gain).ln().powi(2)))
            .collect();
        (known.iter().sum::<f64>() / known.len().max(1) as f64).sqrt()
    }

    /// Decides whether training heeds them, if that is due after the share `progress` of a run in which
    /// `trained` frames are trained on. Returns the spread that it was decided by.
    fn decide(&mut self, config: &ExposureConfig, progress: f64, trained: usize) -> Option<f64> {
        let fitted = self.frames.iter().flatten().count() as f64;
        if self.heeded.is_some() || progress < config.decide || fitted < JUDGED_ON * trained as f64
        {
            return None;
        }
        let spread = self.spread();
        self.heeded = Some(spread > config.least);
        Some(spread)
    }

    /// Moves the exposure of the frame at `position` by `share` of the way to what a fit has `found`.
    fn take(&mut self, position: usize, found: &FrameExposure, share: f64) {
        let before = self.frames[position].unwrap_or(FrameExposure::NEUTRAL);
        self.frames[position] = Some(before.towards(found, share as f32));
        self.centre();
    }

    /// Makes the mean of all known exposures neutral.
    fn centre(&mut self) {
        let known = || self.frames.iter().flatten();
        let count = known().count().max(1) as f32;
        let gain: [f32; 3] =
            std::array::from_fn(|c| (known().map(|it| it.gain[c].ln()).sum::<f32>() / count).exp());
        let offset: [f32; 3] =
            std::array::from_fn(|c| known().map(|it| it.offset[c]).sum::<f32>() / count);
        for frame in self.frames.iter_mut().flatten() {
            for c in 0..3 {
                frame.gain[c] /= gain[c];
                frame.offset[c] -= offset[c];
            }
        }
    }
}

#[cfg(test)]
mod tests;
