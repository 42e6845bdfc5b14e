//! Refined poses of training frames: a change per frame.
//!
//! The mean of all changes stays zero, since a change that all frames share is a change of the
//! canonical body as well.

mod growth;

use crate::config::{Extent, RefinementConfig, RefinementStage};
use crate::fit::{Evidence, PoseChange, StepPrior};
use crate::train::poses::expected_errors::ExpectedErrors;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::readings::Reading;
use yoto_proto::hex;
use yoto_proto::pose_track::PoseTrack;

/// Misfit, relative to that of other frames at that time, at which a frame counts half.
const DOUBTFUL: f64 = 4.0;
/// Relative misfit above which other readings are tried.
const SUSPECT: f64 = 1.5;
/// Weight of the newest misfit in the typical one.
const SMOOTHING: f32 = 0.03;
/// Shares of the refinement after which other readings are tried.
const TRIALS: [f64; 5] = [0.1, 0.25, 0.4, 0.6, 0.8];
/// Errors that are expected of poses that are refined finely, as factors of the configured ones: rotations by about
/// 1 degree, as of BlazePose in films of one person (docs/research/refinement.md), and positions.
const FINE: [f64; 2] = [0.4, 0.4];
/// Farthest frames between which a lost one is placed.
const FAR: usize = 10;

/// Changes of a track's poses, and how well they fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct PoseRefinement {
    /// Fingerprint of the poses that were given.
    track: String,
    /// The change of each frame of the track.
    changes: Vec<PoseChange>,
    /// Whether they are found over one run of a model whose own refinement was over.
    late: bool,
    #[serde(default)]
    extent: Extent,
    /// Whether they change no more.
    done: bool,
    /// Whether it was decided if the given poses are exact.
    #[serde(default)]
    judged: bool,
    /// Number of fits so far.
    #[serde(default)]
    fits: u32,
    /// Latest misfit of each frame relative to the typical one then, once it was fitted.
    misfits: Vec<Option<f32>>,
    /// Logarithm of the typical misfit: a moving mean over the frames that were fitted last.
    typical: Option<f32>,
    /// Number of [`TRIALS`] of each frame that are past.
    tried: Vec<u8>,
    #[serde(default = "ExpectedErrors::configured")]
    errors: ExpectedErrors,
    /// 1 while splats are few, 2 once they are more, or were placed again by an earlier version, 3 once they are all;
    /// 0 if those of an earlier training stay.
    #[serde(default)]
    placed: u8,
    /// Progress at the placement, as [`Self::stage`] counts progress. In single precision, which a
    /// file of JSON gives back exactly.
    #[serde(default)]
    placed_at: f32,
    /// Frames that are not read as they were given, and their poses before the change.
    readings: BTreeMap<usize, (Reading, Pose)>,
}

impl PoseRefinement {
    /// No change yet of the poses of `track`; `late` if the model's own refinement is over.
    pub(crate) fn new(track: &PoseTrack, extent: Extent, late: bool) -> Self {
        Self {
            track: fingerprint(track),
            late,
            extent,
            done: false,
            judged: false,
            fits: 0,
            typical: None,
            errors: expected(extent),
            changes: vec![PoseChange::none(track.joints()); track.frames.len()],
            misfits: vec![None; track.frames.len()],
            tried: vec![0; track.frames.len()],
            placed: 0,
            placed_at: 0.0,
            readings: BTreeMap::new(),
        }
    }

    /// Whether the changes are of a skeleton with `joints` joints, and finite.
    pub(crate) fn fits(&self, joints: usize) -> bool {
        let frames = self.changes.len();
        (self.misfits.len(), self.tried.len()) == (frames, frames)
            && self.errors.are_valid()
            && (self.readings.iter())
                .all(|(position, (_, pose))| *position < frames && pose.rotations.len() == joints)
            && (self.changes.iter())
                .all(|it| it.0.len() == 3 * (joints + 1) && it.0.iter().all(|v| v.is_finite()))
    }

    /// Whether the changes are of the poses of `track`.
    pub(crate) fn is_of(&self, track: &PoseTrack) -> bool {
        self.track == fingerprint(track) && self.changes.len() == track.frames.len()
    }

    /// The settings of refinement now, after the completed fraction `schedule_progress` of the model's first run
    /// and `fraction` of this one; `None` where they are not.
    pub(crate) fn stage(
        &mut self,
        config: &RefinementConfig,
        schedule_progress: f64,
        fraction: f64,
    ) -> Option<RefinementStage> {
        let progress = self.progress(schedule_progress, fraction);
        self.done |= progress >= config.end;
        self.judge(config, progress);
        let stage = match self.done {
            true => None,
            false => config.stage(self.extent, progress),
        };
        match self.extent {
            Extent::Fine if !self.judged => stage.map(RefinementStage::observing),
            _ => stage,
        }
    }

    /// Decides, after the share `progress` of the run, whether the given poses are exact; then they stay, and so
    /// they do if too few fits tell. Until then, fine fits only observe.
    fn judge(&mut self, config: &RefinementConfig, progress: f64) {
        if self.judged || self.extent == Extent::Wide || progress < config.judged {
            return;
        }
        let tell = self.fits >= config.telling;
        if !tell && progress < config.judged_last {
            return;
        }
        self.judged = true;
        let errors = self.errors(config).filter(|_| tell);
        self.done |= errors.is_none_or(|[rotation, _]| rotation < config.exact);
    }

    /// Whether the pose of a frame is fitted before the step that follows `step` others.
    pub(crate) fn fits_before(&self, config: &RefinementConfig, step: u64) -> bool {
        config.fits_before(self.extent, step)
    }

    /// Progress of the run in which the poses are refined, from that of the model's first run and that
    /// of this one.
    fn progress(&self, schedule_progress: f64, fraction: f64) -> f64 {
        if self.late {
            fraction
        } else {
            schedule_progress
        }
    }

    /// The given `pose` of the frame at `position` in the track as it is read, without its change.
    pub(crate) fn read(&self, position: usize, pose: &Pose) -> Pose {
        let read = self.readings.get(&position).map_or(pose, |(_, pose)| pose);
        read.clone()
    }

    /// The given `pose` of the frame at `position` as it is read, with its change.
    pub(crate) fn refined(&self, position: usize, pose: &Pose) -> Pose {
        self.changes[position].of(&self.read(position, pose))
    }

    /// The change at the share `at` of the way from that of one frame to that of another.
    pub(crate) fn change_between(&self, [from, to]: [usize; 2], at: f64) -> PoseChange {
        let (from, to) = (&self.changes[from].0, &self.changes[to].0);
        let pairs = from.iter().zip(to);
        PoseChange(pairs.map(|(a, b)| a + at as f32 * (b - a)).collect())
    }

    /// `pose` of a frame that is not in the track, changed by what lies at the share `at` of the way from the frame at
    /// one position to that at another.
    pub(crate) fn near(&self, positions: [usize; 2], at: f64, pose: &Pose) -> Pose {
        let [from, to] = positions;
        match [from, to].map(|it| self.has_usual_axes(it)) {
            [true, true] => self.change_between([from, to], at).of(pose),
            [true, false] => self.changes[from].of(pose),
            [false, true] => self.changes[to].of(pose),
            [false, false] => pose.clone(),
        }
    }

    /// Notes how far the frame at `position` was from its picture.
    pub(crate) fn note(&mut self, position: usize, misfit: f64) {
        let log = (misfit as f32).max(f32::MIN_POSITIVE).ln();
        if !log.is_finite() {
            return;
        }
        let typical = self.typical.get_or_insert(log);
        self.misfits[position] = Some((log - *typical).exp());
        // A few frames that are altogether wrong hardly move it.
        *typical += SMOOTHING * (log - *typical).clamp(-1.0, 1.0);
    }

    /// The latest misfit of the frame at `position` relative to the typical one; 1 while it is unknown.
    fn misfit(&self, position: usize) -> f64 {
        self.misfits[position].map_or(1.0, f64::from)
    }

    /// The weight of the frame at `position` in training, 0 to 1: frames that fit far worse than
    /// others show something else, or the person elsewhere.
    pub(crate) fn weight(&self, position: usize) -> f64 {
        1.0 / (1.0 + (self.misfit(position) / DOUBTFUL).powi(4))
    }

    /// Whether other readings of the frame at `position` should be tried now, after the share `passed`
    /// of the refinement. Bodies that hardly wander off their masks are read rightly.
    pub(crate) fn suspects(&self, position: usize, passed: f64) -> bool {
        if self.extent == Extent::Fine {
            return false;
        }
        let due = TRIALS.iter().filter(|at| passed >= **at).count();
        usize::from(self.tried[position]) < due && self.misfit(position) > SUSPECT
    }

    /// Notes that other readings of the frame at `position` were tried after the share `passed` of the
    /// refinement, and that `found` fits, with its change, if any does.
    pub(crate) fn tried(
        &mut self,
        position: usize,
        passed: f64,
        found: Option<(Reading, Pose, PoseChange)>,
    ) {
        self.tried[position] = TRIALS.iter().filter(|at| passed >= **at).count() as u8;
        let Some((reading, pose, change)) = found else {
            return;
        };
        self.misfits[position] = None;
        self.changes[position] = change;
        match reading {
            Reading::Given => self.readings.remove(&position),
            reading => self.readings.insert(position, (reading, pose)),
        };
    }

    /// Whether the axes of the frame's joints are those of its neighbours: they are not where sides
    /// are exchanged.
    fn has_usual_axes(&self, position: usize) -> bool {
        let reading = self.readings.get(&position).map(|(reading, _)| *reading);
        matches!(reading, None | Some(Reading::Between))
    }

    /// The positions nearest to `position` on both sides, up to [`FAR`] frames away, whose frames fit.
    pub(crate) fn fitting_around(&self, position: usize) -> Option<[usize; 2]> {
        let fits = |position: &usize| {
            self.misfits[*position].is_some_and(|misfit| f64::from(misfit) < SUSPECT)
                && self.has_usual_axes(*position)
        };
        let before = (position.saturating_sub(FAR)..position).rev().find(fits)?;
        let after = (position + 1..self.changes.len().min(position + FAR + 1)).find(fits)?;
        Some([before, after])
    }

    /// Positions that are not read as given, and positions that hardly count though other readings were
    /// tried, rising.
    pub(crate) fn doubts(&self) -> (Vec<(usize, Reading)>, Vec<usize>) {
        let readings = self.readings.iter();
        let positions = 0..self.changes.len();
        let hardly =
            positions.filter(|position| self.tried[*position] > 0 && self.weight(*position) < 0.1);
        (
            readings
                .map(|(position, (reading, _))| (*position, *reading))
                .collect(),
            hardly.collect(),
        )
    }

    /// `pose` of the frame at `position`, which is not trained on, changed as its neighbours are.
    pub(crate) fn as_neighbours(&self, position: usize, pose: &Pose) -> Pose {
        let beside = self.beside(position);
        let mut mean = PoseChange(vec![0.0; self.changes[position].0.len()]);
        for change in &beside {
            for (mean, value) in mean.0.iter_mut().zip(&change.0) {
                *mean += value / beside.len() as f32;
            }
        }
        mean.of(pose)
    }

    /// The changes of the frames beside the one at `position`, in the same axes.
    fn beside(&self, position: usize) -> Vec<&PoseChange> {
        if !self.has_usual_axes(position) {
            return Vec::new();
        }
        let beside = [position.checked_sub(1), position.checked_add(1)];
        (beside.into_iter().flatten())
            .filter(|position| self.has_usual_axes(*position))
            .filter_map(|position| self.changes.get(position))
            .collect()
    }

    /// The return of the frame at `position` to its given pose.
    pub(crate) fn given_priors(
        &self,
        config: &RefinementConfig,
        position: usize,
    ) -> Vec<StepPrior> {
        self.changes[position].priors(config, self.errors.factors())
    }

    /// Learns from a fit of the frame at `position`, after the share `passed` of the refinement, how far
    /// given poses are off.
    pub(crate) fn learn(&mut self, position: usize, evidence: &[Evidence; 2], passed: f64) {
        let weight = self.weight(position);
        match self.extent {
            Extent::Wide => self.errors.learn(evidence, weight, passed),
            // Fine fits start with a model that shows enough.
            Extent::Fine if self.judged => self.errors.learn(evidence, weight, 1.0),
            Extent::Fine => self.errors.observe(evidence, weight, self.fits),
        }
        self.fits = self.fits.saturating_add(1);
    }

    /// How far given poses are off: rotations about each axis, radians, and positions along each,
    /// metres; `None` until fits have found it.
    pub(crate) fn errors(&self, config: &RefinementConfig) -> Option<[f64; 2]> {
        let [rotation, shift] = self.errors.factors();
        let learned = self.errors != expected(self.extent);
        learned.then_some([rotation * config.rotation, shift * config.shift])
    }

    /// The priors of the frame at `position` without its picture: return to its given pose, and be
    /// changed as its neighbours are.
    pub(crate) fn priors(&self, config: &RefinementConfig, position: usize) -> Vec<StepPrior> {
        let beside = self.beside(position);
        let precision = |error: f64| error.powi(-2);
        let mut priors = self.given_priors(config, position);
        let rotations = priors.len() - 3;
        let [rotation, shift] = self.errors.factors();
        if beside.is_empty() {
            return priors;
        }
        for (i, prior) in priors.iter_mut().enumerate() {
            let jitter = if i < rotations {
                rotation * config.rotation_jitter
            } else {
                shift * config.shift_jitter
            };
            let sum: f64 = beside.iter().map(|it| f64::from(it.0[i])).sum();
            let mean = sum / beside.len() as f64;
            let alike = precision(jitter);
            let both = prior.precision + alike;
            prior.mean += alike * mean / both;
            prior.precision = both;
        }
        priors
    }

    /// Takes a `step` `[3 (K + 1)]` of the frame at `position`, in the axes of its refined pose.
    /// Neighbours follow.
    pub(crate) fn take(&mut self, position: usize, step: &[f64], stage: &RefinementStage) {
        self.changes[position].take(step, stage.share);
        if !self.has_usual_axes(position) {
            return;
        }
        // Beyond 2.5 standard deviations nothing follows noticeably.
        for distance in 1..=(2.5 * stage.reach) as usize {
            let by = stage.share * (-0.5 * (distance as f64 / stage.reach).powi(2)).exp();
            let beside = [
                position.checked_sub(distance),
                position.checked_add(distance),
            ];
            for position in beside.into_iter().flatten() {
                if position < self.changes.len() && self.has_usual_axes(position) {
                    self.changes[position].take(step, by);
                }
            }
        }
        self.centre();
    }

    /// Subtracts the mean of all changes in the usual axes.
    fn centre(&mut self) {
        let positions = 0..self.changes.len();
        let usual: Vec<usize> = positions.filter(|it| self.has_usual_axes(*it)).collect();
        for i in 0..self.changes.first().map_or(0, |it| it.0.len()) {
            let sum: f64 = (usual.iter())
                .map(|position| f64::from(self.changes[*position].0[i]))
                .sum();
            let mean = (sum / usual.len().max(1) as f64) as f32;
            for position in &usual {
                self.changes[*position].0[i] -= mean;
            }
        }
    }
}

/// The expected errors of given poses before fits have found it. Those that are refined finely are within
/// [`PRECISE`](yoto_capture::check::PRECISE).
fn expected(extent: Extent) -> ExpectedErrors {
    match extent {
        Extent::Wide => ExpectedErrors::configured(),
        Extent::Fine => ExpectedErrors::of(FINE),
    }
}

/// SHA-256 of a track's poses.
fn fingerprint(track: &PoseTrack) -> String {
    let mut hash = Sha256::new();
    for frame in &track.frames {
        for number in frame.pose.iter().chain(&frame.translation) {
            hash.update(number.to_le_bytes());
        }
    }
    hex(&hash.finalize())
}

#[cfg(test)]
#[path = "refinement_tests.rs"]
mod tests;
