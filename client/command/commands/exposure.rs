//! For whose films a training learns exposures.

use clap::ValueEnum;
use yoto_proto::v1::ExposureLearning;

/// `--exposure`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Exposure {
    /// Those whose frames are exposed differently.
    Auto,
    /// Everybody's.
    Always,
    /// Nobody's.
    Never,
}

impl Exposure {
    /// The same for the service.
    pub(super) fn message(self) -> ExposureLearning {
        match self {
            Self::Auto => ExposureLearning::Auto,
            Self::Always => ExposureLearning::Always,
            Self::Never => ExposureLearning::Never,
        }
    }
}
