//! What a check found: typed for programs, worded for people.

use serde::{Deserialize, Serialize};
use yoto_proto::correction::Correction;

/// How good something is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Grade {
    /// Nothing to mend.
    Pass,
    /// Training works, and would work better.
    Warn,
    /// Training would learn something wrong, or nothing.
    Fail,
}

impl Grade {
    /// `pass`, `warn` or `fail`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Warn => "warn",
            Self::Fail => "fail",
        }
    }
}

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Whether another reading of the numbers fits the masks decisively better.
    Reading,
    /// By how many frames masks or poses are late.
    Timing,
    /// The body's size, metres.
    BodySize,
    /// Share of projected joints that fall in the mask.
    JointsInMask,
    /// Share of mask pixels inside the projected box.
    MaskInBox,
    /// Overlap of the projected body with the mask.
    Silhouette,
    /// Overlap of what the image shows with the mask.
    ImageInMask,
    /// Whether the masks show one whole person.
    Masks,
    /// From how many of 12 directions the body is seen.
    Views,
    /// Frames in which a joint jumps.
    Jumps,
    /// How far joints tremble, metres.
    Jitter,
    /// How far poses wander off their frames, metres.
    Precision,
    /// Frames that repeat the one before although the pose moved.
    Duplicates,
    /// Width of edges, pixels.
    Blur,
    /// Share of the person's pixels that are burnt out or black.
    Exposure,
}

impl Kind {
    /// The name people read.
    pub fn title(self) -> &'static str {
        match self {
            Self::Reading => "reading of the numbers",
            Self::Timing => "timing",
            Self::BodySize => "body size",
            Self::JointsInMask => "joints in the mask",
            Self::MaskInBox => "mask in the box",
            Self::Silhouette => "silhouette",
            Self::ImageInMask => "image in the mask",
            Self::Masks => "masks",
            Self::Views => "view coverage",
            Self::Jumps => "pose jumps",
            Self::Jitter => "pose jitter",
            Self::Precision => "pose precision",
            Self::Duplicates => "duplicate frames",
            Self::Blur => "blur",
            Self::Exposure => "exposure",
        }
    }
}

/// One thing measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measure {
    /// What.
    pub kind: Kind,
    /// How good it is.
    pub grade: Grade,
    /// The figure, in the unit that [`Kind`] names; none where nothing could be measured.
    pub value: Option<f64>,
    /// The figure with its unit, for people.
    pub shown: String,
    /// What the figure means for training.
    pub meaning: String,
    /// The likeliest cause, where the grade is not a pass.
    pub cause: Option<String>,
    /// Indices of the worst frames, a few.
    pub frames: Vec<u32>,
}

/// A mistake that would explain what was measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cause {
    /// What is wrong, e.g. "extrinsics look camera-to-world".
    pub what: String,
    /// Options of the command line that undo it; empty where none does.
    pub options: String,
    /// What the options ask for.
    #[serde(skip)]
    pub correction: Option<Correction>,
    /// Overlap of body and mask (0 to 1) as given.
    pub fit: f64,
    /// The same with the mistake undone.
    pub fit_mended: f64,
    /// Other options that fit as well.
    pub alternatives: Vec<String>,
}

impl Cause {
    /// One sentence for people.
    pub fn sentence(&self) -> String {
        let fit = format!(
            "body and masks then overlap by {:.0} % instead of {:.0} %",
            100.0 * self.fit_mended,
            100.0 * self.fit
        );
        let mut text = self.what.clone();
        if !self.options.is_empty() {
            text += &format!(": try `{}`", self.options);
        }
        if !self.alternatives.is_empty() {
            text += &format!(" (or `{}`)", self.alternatives.join("`, `"));
        }
        format!("{text}; {fit}")
    }
}

/// Another reading of the numbers, and how well it fits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tried {
    /// The options that ask for it; empty for the numbers as given.
    pub options: String,
    /// Mean overlap of the projected body with the mask, 0 to 1.
    pub fit: f64,
}

/// Everything a check found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Frames of the pose track.
    pub frames: usize,
    /// Frames whose pictures were looked at.
    pub looked_at: usize,
    /// The worst grade.
    pub grade: Grade,
    /// What was measured.
    pub measures: Vec<Measure>,
    /// What would explain what is wrong, the likeliest first.
    pub causes: Vec<Cause>,
    /// Frames seen from each of 12 directions of 30 degrees around the body, from its front
    /// towards its left.
    pub headings: [usize; 12],
    /// What to film next time, in words; empty where nothing is missing.
    #[serde(default)]
    pub advice: Vec<String>,
    /// The readings that were tried, the best first.
    pub tried: Vec<Tried>,
    /// Overlap of the body with the mask so many frames later, as gain over no shift.
    pub mask_shifts: Vec<(i32, f64)>,
}

impl Report {
    /// The measure of `kind`.
    pub fn measure(&self, kind: Kind) -> Option<&Measure> {
        self.measures.iter().find(|measure| measure.kind == kind)
    }

    /// Why training on this would be pointless: hardly a joint in the masks, or hardly a mask
    /// where rays are shot. None where it is worth trying, warnings and all.
    pub fn pointless(&self) -> Option<String> {
        /// Shares under which nothing can be learnt.
        const HARDLY: f64 = 0.1;
        let missed = [Kind::JointsInMask, Kind::MaskInBox];
        let measure = missed
            .into_iter()
            .filter_map(|kind| self.measure(kind))
            .find(|measure| measure.value.is_some_and(|value| value < HARDLY))?;
        let cause = match self.causes.first() {
            Some(cause) => format!("; {}", cause.sentence()),
            None => String::new(),
        };
        Some(format!(
            "{}: {}, {}{cause}",
            measure.kind.title(),
            measure.shown,
            measure.meaning
        ))
    }
}
