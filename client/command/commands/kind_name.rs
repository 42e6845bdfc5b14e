//! Kinds of jobs on the command line.

use super::titles::kind_word;
use clap::ValueEnum;
use yoto_proto::v1::JobKind;

/// A kind of jobs.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum KindName {
    Ingest,
    Train,
    Render,
    Evaluate,
    Export,
}

impl KindName {
    /// The word for it.
    pub(super) fn word(self) -> &'static str {
        kind_word(self.into())
    }
}

impl From<KindName> for JobKind {
    fn from(name: KindName) -> Self {
        match name {
            KindName::Ingest => Self::Ingest,
            KindName::Train => Self::Train,
            KindName::Render => Self::Render,
            KindName::Evaluate => Self::Evaluate,
            KindName::Export => Self::Export,
        }
    }
}
