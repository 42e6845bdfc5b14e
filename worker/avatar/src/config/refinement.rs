//! Refinement of the poses of training frames.

use super::ConfigError;
use serde::{Deserialize, Serialize};
use yoto_proto::v1::PoseRefinement;

/// The people whose poses a training refines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Refine {
    /// Nobody's.
    #[default]
    Never,
    /// People whose bodies wander off their masks ([`PRECISE`](yoto_capture::check::PRECISE)),
    /// or jump as no body can. With splats, those of all others as well, but finely ([`Extent::Fine`]).
    Auto,
    /// Everybody's.
    Always,
}

/// How far a training refines the poses of a person.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Extent {
    /// Errors of degrees and centimetres: pictures are much blurred at first, splats are few, and there is a fit
    /// before each step.
    #[default]
    Wide,
    /// Errors of about a pixel, which blur a face: little blur, all splats, fits before some of the steps.
    Fine,
}

impl Refine {
    /// The choice of an order; `None` leaves the choice to the configuration.
    pub fn ordered(order: PoseRefinement) -> Option<Self> {
        match order {
            PoseRefinement::Unspecified => None,
            PoseRefinement::Always => Some(Self::Always),
            PoseRefinement::Never => Some(Self::Never),
            PoseRefinement::Auto => Some(Self::Auto),
        }
    }
}

/// Refinement of the poses of training frames: before each step, the pose of its frame is fitted
/// to the frame with the model as it is then. It belongs to the frames, not to the model: renders
/// take other poses as they are given. Every value was chosen by experiment (docs/research/refinement.md).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RefinementConfig {
    /// The people whose poses are refined.
    pub who: Refine,
    /// Start, as a share of the run.
    pub start: f64,
    /// End, as a share of the run: after it, the model learns from fixed poses.
    pub end: f64,
    /// Share of the steps before which a pose is fitted.
    pub share: f64,
    /// Blur of the compared pictures at the start, as a share of the person's longer side in the
    /// picture: a fit corrects errors of about the size of the blur.
    pub first_blur: f64,
    /// Blur at the end.
    pub last_blur: f64,
    /// For [`Extent::Fine`]: the start, as a share of the run. A model that is hardly learned would spoil good
    /// poses.
    pub fine_start: f64,
    /// For [`Extent::Fine`]: the share of the steps before which a pose is fitted.
    pub fine_share: f64,
    /// For [`Extent::Fine`]: the blur at the start and at the end.
    pub fine_blur: [f64; 2],
    /// Error of given rotations about each axis, radians, below which poses stay as given once that is known,
    /// after [`Self::judged`] of the run: fits would add more than they find.
    pub exact: f64,
    /// Share of the run after which that is decided.
    pub judged: f64,
    /// Fewest fits that tell it: the decision waits for them, at most until [`Self::judged_last`] of the run.
    pub telling: u32,
    /// Share of the run after which poses stay as given if fewer fits than [`Self::telling`] were made.
    pub judged_last: f64,
    /// Frames to both sides that follow a frame's step at the start, by a Gauss curve; none from
    /// two thirds on. Errors of neighbours are alike.
    pub reach: f64,
    /// Expected error of a given rotation about each axis, radians. Configurations call it `turn`.
    #[serde(rename = "turn")]
    pub rotation: f64,
    /// Expected error of the root's given position along each axis, metres.
    pub shift: f64,
    /// Expected change of a rotation's error from the mean of its neighbours, radians. Configurations call it
    /// `turn_jitter`.
    #[serde(rename = "turn_jitter")]
    pub rotation_jitter: f64,
    /// Expected change of the position's error from the mean of its neighbours, metres.
    pub shift_jitter: f64,
    /// Expected difference of a blurred value from the model's where the pose is right.
    pub noise: f64,
}

impl Default for RefinementConfig {
    /// No refinement.
    fn default() -> Self {
        Self {
            who: Refine::Never,
            start: 0.05,
            end: 0.9,
            share: 1.0,
            first_blur: 0.04,
            last_blur: 0.007,
            fine_start: 0.2,
            fine_share: 0.5,
            fine_blur: [0.02, 0.004],
            exact: 0.0047,
            judged: 0.3,
            telling: 30,
            judged_last: 0.6,
            reach: 2.0,
            rotation: 0.05,
            shift: 0.02,
            rotation_jitter: 0.03,
            shift_jitter: 0.01,
            noise: 0.1,
        }
    }
}

/// The settings of pose refinement at one point of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RefinementStage {
    /// Blur, as a share of the person's longer side in the picture.
    pub blur: f64,
    /// Standard deviation of the curve by which neighbours follow, frames.
    pub reach: f64,
    /// Share of a fit's step that is taken.
    pub share: f64,
    /// Passed share of the refinement.
    pub passed: f64,
}

impl RefinementStage {
    /// The same stage without any step taken: what fits ask for tells how far given poses are off.
    pub(crate) fn observing(self) -> Self {
        Self { share: 0.0, ..self }
    }
}

impl RefinementConfig {
    /// Whether training learns from refined poses after the completed fraction `progress` of a run:
    /// those that it has found stay when it no longer changes them.
    pub fn takes_part(&self, progress: f64) -> bool {
        progress >= self.start
    }

    /// The settings of pose refinement to an `extent` after the completed fraction `progress` of a run; `None` where they
    /// are not.
    pub(crate) fn stage(&self, extent: Extent, progress: f64) -> Option<RefinementStage> {
        let start = match extent {
            Extent::Wide => self.start,
            Extent::Fine => self.fine_start,
        };
        if progress < start || progress >= self.end {
            return None;
        }
        let passed = (progress - start) / (self.end - start);
        Some(RefinementStage {
            blur: self.blur(extent, passed),
            reach: self.reach * (1.0 - 1.5 * passed).max(0.0),
            share: 1.0 - 0.5 * passed,
            passed,
        })
    }

    /// Whether a pose is fitted before the step that follows `step` others.
    pub(crate) fn fits_before(&self, extent: Extent, step: u64) -> bool {
        let share = match extent {
            Extent::Wide => self.share,
            Extent::Fine => self.fine_share,
        };
        let fits = |steps: u64| (steps as f64 * share).floor();
        fits(step + 1) > fits(step)
    }

    /// Blur after the share `passed` of a fit.
    pub(crate) fn blur(&self, extent: Extent, passed: f64) -> f64 {
        let [first, last] = match extent {
            Extent::Wide => [self.first_blur, self.last_blur],
            Extent::Fine => self.fine_blur,
        };
        first * (last / first).powf(passed)
    }

    /// Checks every field.
    ///
    /// # Errors
    /// The first one that is out of its range.
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        let wrong = |field, message: &str| {
            Err(ConfigError::Field {
                field,
                message: message.into(),
            })
        };
        for (field, share) in [
            ("refinement.start", self.start),
            ("refinement.end", self.end),
            ("refinement.share", self.share),
            ("refinement.fine_start", self.fine_start),
            ("refinement.fine_share", self.fine_share),
            ("refinement.judged", self.judged),
            ("refinement.judged_last", self.judged_last),
        ] {
            if !(0.0..=1.0).contains(&share) {
                return wrong(field, "must be between 0 and 1");
            }
        }
        if self.start.max(self.fine_start) >= self.end {
            return wrong(
                "refinement.end",
                "must come after refinement.start and refinement.fine_start",
            );
        }
        for (field, blur) in [
            ("refinement.first_blur", self.first_blur),
            ("refinement.last_blur", self.last_blur),
            ("refinement.fine_blur", self.fine_blur[0]),
            ("refinement.fine_blur", self.fine_blur[1]),
        ] {
            if !(1e-3..=0.5).contains(&blur) {
                return wrong(field, "must be between 0.001 and 0.5");
            }
        }
        if !(0.0..=100.0).contains(&self.reach) {
            return wrong("refinement.reach", "must be between 0 and 100 frames");
        }
        for (field, value) in [
            ("refinement.turn", self.rotation),
            ("refinement.shift", self.shift),
            ("refinement.turn_jitter", self.rotation_jitter),
            ("refinement.shift_jitter", self.shift_jitter),
            ("refinement.noise", self.noise),
            ("refinement.exact", self.exact),
        ] {
            if !(1e-6..=1e3).contains(&value) {
                return wrong(field, "must be between 1e-6 and 1000");
            }
        }
        Ok(())
    }
}
