//! Whose poses a training refines.

use clap::ValueEnum;
use yoto_proto::v1::PoseRefinement;

/// `--refine-poses`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum RefinePoses {
    /// Everybody's.
    Always,
    /// Nobody's.
    Never,
    /// Those of people whose bodies wander off their masks or jump.
    Auto,
}

impl RefinePoses {
    /// The same for the service.
    pub(super) fn message(self) -> PoseRefinement {
        match self {
            Self::Always => PoseRefinement::Always,
            Self::Never => PoseRefinement::Never,
            Self::Auto => PoseRefinement::Auto,
        }
    }
}
