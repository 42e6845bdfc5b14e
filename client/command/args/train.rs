//! Options of trainings, and the one conversion to what the service trains by.

use clap::{Args, ValueEnum};
use yoto_proto::v1::{AppearancePrior, ExposureLearning, PoseRefinement, TrainSpec};

/// What a training may learn besides the people.
#[derive(Debug, Clone, Args)]
pub(crate) struct TrainArgs {
    /// Random seed; a model with earlier training keeps its own.
    #[arg(long, default_value_t = 7)]
    pub seed: u64,
    /// Refine the poses of the training frames: always, never, or auto. With auto, they are refined for people whose
    /// bodies wander off their masks or jump, as estimated poses do; with splats, all other poses get small
    /// corrections [default: as in the model's last training, or auto; never for the tiers of the paper].
    #[arg(long, value_enum, value_name = "WHEN", num_args = 0..=1, default_missing_value = "always", require_equals = true)]
    pub refine_poses: Option<RefinePoses>,
    /// Learn a gain and an offset for each training frame and colour channel: always, never, or auto, which is for
    /// films with varying exposure [default: as in the model's last training, or auto for splat and never for other
    /// tiers].
    #[arg(long, value_enum, value_name = "WHEN")]
    pub exposure: Option<Exposure>,
    /// Let the colours of splats depend on the view, by spherical harmonics of this degree, 0 to 2, for shiny
    /// surfaces [default: as in the model's last training, or 0].
    #[arg(long, value_name = "DEGREE", value_parser = clap::value_parser!(u32).range(0..=2))]
    pub harmonics: Option<u32>,
    /// Keep the trained colours of parts that no frame shows, instead of guessing them from visible parts.
    #[arg(long)]
    pub leave_unseen: bool,
    /// How people look where no frame shows them.
    #[arg(long, value_enum, value_name = "WHO", default_value = "people")]
    pub init: Init,
}

impl TrainArgs {
    /// The training that these options describe, with the service's defaults for everything else and no model yet.
    pub(crate) fn spec(&self) -> TrainSpec {
        TrainSpec {
            seed: self.seed,
            refine_poses: self.refine_poses.map_or(0, |when| when.message().into()),
            exposure: self.exposure.map_or(0, |when| when.message().into()),
            harmonics: self.harmonics,
            leave_unseen: self.leave_unseen,
            prior: self.init.message().into(),
            ..TrainSpec::default()
        }
    }
}

/// `--refine-poses`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum RefinePoses {
    /// Refine everybody's poses.
    Always,
    /// Refine nobody's poses.
    Never,
    /// Refine the poses of people whose bodies wander off their masks or jump; with splats, small corrections to all others.
    Auto,
}

impl RefinePoses {
    /// The choice as the service's message has it.
    pub(crate) fn message(self) -> PoseRefinement {
        match self {
            Self::Always => PoseRefinement::Always,
            Self::Never => PoseRefinement::Never,
            Self::Auto => PoseRefinement::Auto,
        }
    }
}

/// `--init`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Init {
    /// Like the people that the program's decoder has learned from.
    People,
    /// Like their own visible parts.
    None,
}

impl Init {
    /// The choice as the service's message has it; the service's own is no choice.
    pub(crate) fn message(self) -> AppearancePrior {
        match self {
            Self::People => AppearancePrior::Unspecified,
            Self::None => AppearancePrior::None,
        }
    }
}

/// `--exposure`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Exposure {
    /// For people whose frames differ in exposure.
    Auto,
    /// For everybody.
    Always,
    /// For nobody.
    Never,
}

impl Exposure {
    /// The choice as the service's message has it.
    pub(crate) fn message(self) -> ExposureLearning {
        match self {
            Self::Auto => ExposureLearning::Auto,
            Self::Always => ExposureLearning::Always,
            Self::Never => ExposureLearning::Never,
        }
    }
}
