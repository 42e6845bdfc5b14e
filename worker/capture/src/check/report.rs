//! The report of a check, with types for programs and texts for people.

use serde::{Deserialize, Serialize};
use yoto_proto::correction::Correction;

/// The grade of a measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Grade {
    /// Nothing to correct.
    Pass,
    /// Training works, but worse than it could.
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
pub enum MeasureKind {
    /// Whether another reading of the numbers fits the masks decisively better.
    Reading,
    /// Delay of masks or poses, frames.
    Timing,
    /// The body's size, metres.
    BodySize,
    /// Share of projected joints that fall in the mask.
    JointsInMask,
    /// Share of mask pixels inside the projected box.
    MaskInBox,
    /// Overlap of the projected body with the mask.
    Silhouette,
    /// Overlap of the image's content with the mask.
    ImageInMask,
    /// Whether the masks show one whole person.
    Masks,
    /// Number of directions, of 12, from which the body is seen.
    Views,
    /// Frames in which a joint jumps.
    Jumps,
    /// Jitter of joints, metres.
    Jitter,
    /// Scatter of poses around their frames, metres.
    Precision,
    /// Frames that repeat the one before although the pose moved.
    Duplicates,
    /// Width of edges, pixels.
    Blur,
    /// Share of the person's pixels that are burnt out or black.
    Exposure,
}

impl MeasureKind {
    /// The name for people.
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

/// One measured value and its grade.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measure {
    /// What is measured.
    pub kind: MeasureKind,
    /// The grade.
    pub grade: Grade,
    /// The value in the unit that [`MeasureKind`] names; `None` if nothing could be measured.
    pub value: Option<f64>,
    /// The value with its unit, for people.
    pub shown: String,
    /// What the value means for training.
    pub meaning: String,
    /// The likeliest cause, if the grade is not a pass.
    pub cause: Option<String>,
    /// Indices of a few of the worst frames.
    pub frames: Vec<u32>,
}

/// A mistake that would explain the measured values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cause {
    /// What is wrong, e.g. "extrinsics look camera-to-world".
    pub what: String,
    /// Command-line options that undo it; empty if none do.
    pub options: String,
    /// The correction that the options ask for.
    #[serde(skip)]
    pub correction: Option<Correction>,
    /// Overlap of body and mask (0 to 1) as given.
    pub fit: f64,
    /// Overlap of body and mask (0 to 1) with the mistake undone.
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

/// Something that a film lacks.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Lack {
    /// What is missing, e.g. "the back was never seen".
    pub what: String,
    /// What it does to the avatar.
    pub effect: String,
    /// What the next film should do instead.
    pub instead: String,
}

impl Lack {
    /// What is missing, and its effect.
    pub fn sentence(&self) -> String {
        format!("{}: {}", self.what, self.effect)
    }

    /// How to film instead, each piece of advice once; `None` if nothing is missing.
    pub fn instead(lacks: &[Self]) -> Option<String> {
        let mut all: Vec<&str> = Vec::new();
        for lack in lacks {
            if !all.contains(&lack.instead.as_str()) {
                all.push(&lack.instead);
            }
        }
        (!all.is_empty()).then(|| all.join("; "))
    }
}

/// Another reading of the numbers, and how well it fits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tried {
    /// The command-line options for it; empty for the numbers as given.
    pub options: String,
    /// Mean overlap of the projected body with the mask, 0 to 1.
    pub fit: f64,
}

/// The result of a check.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CheckReport {
    /// Frames of the pose track.
    pub frames: usize,
    /// Frames that were looked at.
    pub looked_at: usize,
    /// The worst grade.
    pub grade: Grade,
    /// All measured values.
    pub measures: Vec<Measure>,
    /// Mistakes that would explain the faults, the likeliest first.
    pub causes: Vec<Cause>,
    /// Frames seen from each of 12 directions of 30 degrees around the body, from its front
    /// towards its left.
    pub headings: [usize; 12],
    /// What the film lacks.
    #[serde(default)]
    pub lacks: Vec<Lack>,
    /// The lacks in words, and how to film instead; empty if nothing is missing.
    #[serde(default)]
    pub advice: Vec<String>,
    /// The readings that were tried, the best first.
    pub tried: Vec<Tried>,
    /// Shifts of the masks in frames, each with its gain in overlap over no shift.
    pub mask_shifts: Vec<(i32, f64)>,
}

impl CheckReport {
    /// The measure of `kind`.
    pub fn measure(&self, kind: MeasureKind) -> Option<&Measure> {
        self.measures.iter().find(|measure| measure.kind == kind)
    }

    /// The reason why training on this capture is pointless: hardly any joint is in the masks, or hardly any mask is where
    /// rays are cast. `None` if training is worth trying, even with warnings.
    pub fn pointless(&self) -> Option<String> {
        /// Below this share nothing can be learnt.
        const HARDLY: f64 = 0.1;
        let missed = [MeasureKind::JointsInMask, MeasureKind::MaskInBox];
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
