//! Refined poses of training frames: a change per frame.
//!
//! The mean of all changes stays zero, since a change that all frames share is a change of the
//! canonical body as well.

use crate::config::{RefinementConfig, RefinementStage};
use crate::fit::{PoseChange, Wish};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::readings::Reading;
use yoto_proto::pose_track::PoseTrack;

/// Misfit relative to the median at which a frame counts half.
const DOUBTFUL: f64 = 4.0;
/// Misfit relative to the median above which other readings are tried.
const SUSPECT: f64 = 1.5;
/// Shares of the refinement after which other readings are tried.
const TRIALS: [f64; 5] = [0.1, 0.25, 0.4, 0.6, 0.8];
/// Farthest frames between which a lost one is placed.
const FAR: usize = 10;

/// Changes of a track's poses, and how well they fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct PoseRefinement {
    /// Fingerprint of the poses that were given.
    track: String,
    /// Of each frame of the track.
    changes: Vec<PoseChange>,
    /// Latest misfit of each frame, once it was fitted.
    misfits: Vec<Option<f32>>,
    /// How often other readings of each frame were tried.
    tried: Vec<u8>,
    /// Frames that are not read as they were given, and their poses before the change.
    readings: BTreeMap<usize, (Reading, Pose)>,
}

impl PoseRefinement {
    /// No change yet of the poses of `track`.
    pub fn new(track: &PoseTrack) -> Self {
        Self {
            track: fingerprint(track),
            changes: vec![PoseChange::none(track.joints()); track.frames.len()],
            misfits: vec![None; track.frames.len()],
            tried: vec![0; track.frames.len()],
            readings: BTreeMap::new(),
        }
    }

    /// Whether the changes are of a skeleton with `joints` joints, and finite.
    pub fn fits(&self, joints: usize) -> bool {
        let frames = self.changes.len();
        (self.misfits.len(), self.tried.len()) == (frames, frames)
            && (self.readings.iter())
                .all(|(place, (_, pose))| *place < frames && pose.rotations.len() == joints)
            && (self.changes.iter())
                .all(|it| it.0.len() == 3 * (joints + 1) && it.0.iter().all(|v| v.is_finite()))
    }

    /// Whether the changes are of the same poses as those of `other`.
    pub fn continues(&self, other: &Self) -> bool {
        self.track == other.track && self.changes.len() == other.changes.len()
    }

    /// The given `pose` of the frame at `place` in the track as it is read, with its change.
    pub fn refined(&self, place: usize, pose: &Pose) -> Pose {
        let read = self.readings.get(&place).map_or(pose, |(_, pose)| pose);
        self.changes[place].of(read)
    }

    /// Notes how far the frame at `place` was from its picture.
    pub fn note(&mut self, place: usize, misfit: f64) {
        self.misfits[place] = Some(misfit as f32);
    }

    /// The misfit of each frame relative to the median of all; 1 while it is unknown.
    fn relative_misfits(&self) -> Vec<f64> {
        let mut known: Vec<f32> = self.misfits.iter().flatten().copied().collect();
        known.sort_unstable_by(f32::total_cmp);
        let median = known.get(known.len() / 2).copied().map_or(0.0, f64::from);
        let relative = |misfit: &Option<f32>| match misfit {
            Some(misfit) if median > 0.0 => f64::from(*misfit) / median,
            _ => 1.0,
        };
        self.misfits.iter().map(relative).collect()
    }

    /// How much the frame at `place` counts in training, 0 to 1: frames that fit far worse than
    /// others show something else, or the person elsewhere.
    pub fn weight(&self, place: usize) -> f64 {
        counts(self.relative_misfits()[place])
    }

    /// Whether other readings of the frame at `place` should be tried now, after the share `passed`
    /// of the refinement.
    pub fn suspects(&self, place: usize, passed: f64) -> bool {
        let due = TRIALS.iter().filter(|at| passed >= **at).count();
        usize::from(self.tried[place]) < due && self.relative_misfits()[place] > SUSPECT
    }

    /// Notes that other readings of the frame at `place` were tried after the share `passed` of the
    /// refinement, and that `found` fits, if any does.
    pub fn tried(&mut self, place: usize, passed: f64, found: Option<(Reading, Pose)>) {
        self.tried[place] = TRIALS.iter().filter(|at| passed >= **at).count() as u8;
        let Some((reading, pose)) = found else {
            return;
        };
        self.misfits[place] = None;
        self.changes[place].0.fill(0.0);
        match reading {
            Reading::Given => self.readings.remove(&place),
            reading => self.readings.insert(place, (reading, pose)),
        };
    }

    /// The places nearest to `place` on both sides, up to [`FAR`] frames away, whose frames fit.
    pub fn fitting_around(&self, place: usize) -> Option<[usize; 2]> {
        let misfits = self.relative_misfits();
        let fits = |place: &usize| self.misfits[*place].is_some() && misfits[*place] < SUSPECT;
        let before = (place.saturating_sub(FAR)..place).rev().find(fits)?;
        let after = (place + 1..self.changes.len().min(place + FAR + 1)).find(fits)?;
        Some([before, after])
    }

    /// Places that are not read as given, and places that hardly count, rising.
    pub fn doubts(&self) -> (Vec<(usize, Reading)>, Vec<usize>) {
        let readings = self.readings.iter();
        let misfits = self.relative_misfits();
        let left_out = (0..self.changes.len()).filter(|place| counts(misfits[*place]) < 0.1);
        (
            readings
                .map(|(place, (reading, _))| (*place, *reading))
                .collect(),
            left_out.collect(),
        )
    }

    /// `pose` of the frame at `place`, which is not trained on, changed as its neighbours are.
    pub fn as_neighbours(&self, place: usize, pose: &Pose) -> Pose {
        let beside = self.beside(place);
        let mut mean = PoseChange(vec![0.0; self.changes[place].0.len()]);
        for change in &beside {
            for (mean, value) in mean.0.iter_mut().zip(&change.0) {
                *mean += value / beside.len() as f32;
            }
        }
        mean.of(pose)
    }

    /// The changes of the frames beside the one at `place`.
    fn beside(&self, place: usize) -> Vec<&PoseChange> {
        let beside = [place.checked_sub(1), place.checked_add(1)];
        (beside.into_iter().flatten())
            .filter_map(|place| self.changes.get(place))
            .collect()
    }

    /// What the frame at `place` should do without its picture: return to its given pose, and be
    /// changed as its neighbours are.
    pub fn wishes(&self, config: &RefinementConfig, place: usize) -> Vec<Wish> {
        let beside = self.beside(place);
        let precision = |error: f64| error.powi(-2);
        let mut wishes = self.changes[place].wishes(config);
        let turns = wishes.len() - 3;
        if beside.is_empty() {
            return wishes;
        }
        for (i, wish) in wishes.iter_mut().enumerate() {
            let jitter = if i < turns {
                config.turn_jitter
            } else {
                config.shift_jitter
            };
            let sum: f64 = beside.iter().map(|it| f64::from(it.0[i])).sum();
            let mean = sum / beside.len() as f64;
            let alike = precision(jitter);
            let both = wish.precision + alike;
            wish.step += alike * mean / both;
            wish.precision = both;
        }
        wishes
    }

    /// Takes a `step` `[3 (K + 1)]` of the frame at `place`, in the axes of its refined pose.
    /// Neighbours follow.
    pub fn take(&mut self, place: usize, step: &[f64], stage: &RefinementStage) {
        self.changes[place].take(step, stage.share);
        // Beyond 2.5 standard deviations nothing follows noticeably.
        for distance in 1..=(2.5 * stage.reach) as usize {
            let by = stage.share * (-0.5 * (distance as f64 / stage.reach).powi(2)).exp();
            let beside = [place.checked_sub(distance), place.checked_add(distance)];
            for place in beside.into_iter().flatten() {
                if let Some(change) = self.changes.get_mut(place) {
                    change.take(step, by);
                }
            }
        }
        self.centre();
    }

    /// Subtracts the mean of all changes.
    fn centre(&mut self) {
        let frames = self.changes.len() as f64;
        for i in 0..self.changes.first().map_or(0, |it| it.0.len()) {
            let sum: f64 = self.changes.iter().map(|it| f64::from(it.0[i])).sum();
            let mean = (sum / frames) as f32;
            for change in &mut self.changes {
                change.0[i] -= mean;
            }
        }
    }
}

/// How much a frame counts whose misfit is `relative` to the median, 0 to 1.
fn counts(relative: f64) -> f64 {
    1.0 / (1.0 + (relative / DOUBTFUL).powi(4))
}

/// SHA-256 of a track's poses.
fn fingerprint(track: &PoseTrack) -> String {
    let mut hash = Sha256::new();
    for frame in &track.frames {
        for number in frame.pose.iter().chain(&frame.translation) {
            hash.update(number.to_le_bytes());
        }
    }
    let digest = hash.finalize();
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_capture::synthetic::SyntheticPerson;

    fn track() -> PoseTrack {
        SyntheticPerson::cast(1, 7)[0].capture(8, 32).0
    }

    #[test]
    fn neighbours_follow_and_the_mean_stays() {
        let mut poses = PoseRefinement::new(&track());
        let mut step = vec![0.0; 3 * (track().joints() + 1)];
        step[4] = 0.1;
        let stage = RefinementStage {
            blur: 0.02,
            reach: 1.0,
            share: 0.5,
            passed: 0.0,
        };
        poses.take(2, &step, &stage);
        let changes: Vec<f64> = (poses.changes.iter())
            .map(|it| f64::from(it.0[4]))
            .collect();
        assert!(changes.iter().sum::<f64>().abs() < 1e-7);
        assert!((changes[2] - changes[7] - 0.05).abs() < 1e-7, "{changes:?}");
        let (near, far) = (changes[1] - changes[7], changes[4] - changes[7]);
        assert!((near - 0.05 * (-0.5_f64).exp()).abs() < 1e-7, "{changes:?}");
        assert!((far - 0.05 * (-2.0_f64).exp()).abs() < 1e-7, "{changes:?}");
    }

    #[test]
    fn wishes_lead_to_the_given_pose_and_the_neighbours() {
        let config = RefinementConfig {
            turn: 1.0,
            turn_jitter: 0.5,
            ..RefinementConfig::default()
        };
        let mut poses = PoseRefinement::new(&track());
        poses.changes[3].0[0] = 0.4;
        poses.changes[5].0[0] = 0.2;
        poses.changes[4].0[0] = 0.1;
        // Neighbours pull to 0.3 four times as strongly as the given pose to 0.
        let wish = poses.wishes(&config, 4)[0];
        assert!((wish.step - (0.24 - 0.1)).abs() < 1e-7 && (wish.precision - 5.0).abs() < 1e-12);
        let frame = Pose::rest(track().joints());
        let mean = f64::from(poses.as_neighbours(4, &frame).rotations[0][0]);
        assert!((mean - 0.3).abs() < 1e-6, "{mean}");
        poses.changes.truncate(1);
        assert_eq!(poses.as_neighbours(0, &frame), frame);
        assert_eq!(poses.wishes(&config, 0)[0].precision, 1.0, "no neighbours");
    }

    #[test]
    fn another_film_of_the_same_length_starts_anew() {
        let track = track();
        let mut other = track.clone();
        other.frames[3].translation[1] += 1e-9;
        let of = |track: &PoseTrack| PoseRefinement::new(track);
        assert!(of(&track).continues(&of(&track)));
        assert!(!of(&track).continues(&of(&other)));
    }
}
