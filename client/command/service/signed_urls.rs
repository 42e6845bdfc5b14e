//! `yoto serve --signed-urls`.

use clap::ValueEnum;
use std::time::Duration;

/// How long a URL of a file can be used: for the largest checkpoint over a slow line. A transfer that takes longer asks for another one.
const LIFE: Duration = Duration::from_secs(15 * 60);

/// Whether clients read and write the object store itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SignedUrls {
    /// All bytes pass through the service.
    Never,
    /// Where the store signs URLs, files come from it, and parts of uploads go to it.
    Auto,
}

impl SignedUrls {
    /// How long a URL can be used, if there are any.
    pub(crate) fn life(self) -> Option<Duration> {
        match self {
            Self::Never => None,
            Self::Auto => Some(LIFE),
        }
    }
}
