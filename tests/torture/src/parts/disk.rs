//! Simulates full disks with a limit on the size of files that this process writes.

use super::controls::Controls;
use anyhow::{Context, Result};
use nix::sys::resource::{RLIM_INFINITY, Resource, getrlimit, setrlimit};
use nix::sys::signal::{SigHandler, Signal, signal};
use std::time::Duration;

/// Interval of reads of the controls.
const INTERVAL: Duration = Duration::from_millis(20);

/// Makes writes beyond the first `bytes` of a file fail with an error; with 0, all writes to files.
///
/// # Errors
/// When the system refuses the limit.
pub(super) fn limit(bytes: u64) -> Result<()> {
    // SAFETY: ignoring a signal installs no handler that could run.
    unsafe { signal(Signal::SIGXFSZ, SigHandler::SigIgn) }.context("ignoring SIGXFSZ")?;
    let (_, hard) = getrlimit(Resource::RLIMIT_FSIZE).context("reading the limit of files")?;
    setrlimit(Resource::RLIMIT_FSIZE, bytes.min(hard), hard).context("limiting files")
}

/// Makes all writes of this process to files fail while the controls say so. Never returns.
pub(super) async fn follow(controls: Controls) {
    let mut full = false;
    loop {
        tokio::time::sleep(INTERVAL).await;
        let wanted = controls.is_full();
        if wanted != full {
            match limit(if wanted { 0 } else { RLIM_INFINITY }) {
                Ok(()) => full = wanted,
                Err(error) => tracing::error!(%error, "could not change the limit of files"),
            }
        }
    }
}
