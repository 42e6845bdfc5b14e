//! Disks without room: the largest file that a process can write.

use super::controls::Controls;
use anyhow::{Context, Result};
use nix::sys::resource::{RLIM_INFINITY, Resource, getrlimit, setrlimit};
use nix::sys::signal::{SigHandler, Signal, signal};
use std::time::Duration;

/// Interval of looks at the controls.
const LOOK: Duration = Duration::from_millis(20);

/// Has writes beyond `bytes` of a file fail with an error; 0: all writes to files.
///
/// # Errors
/// When the system refuses the limit.
pub fn limit(bytes: u64) -> Result<()> {
    // SAFETY: ignoring a signal installs no handler that could run.
    unsafe { signal(Signal::SIGXFSZ, SigHandler::SigIgn) }.context("ignoring SIGXFSZ")?;
    let (_, hard) = getrlimit(Resource::RLIMIT_FSIZE).context("reading the limit of files")?;
    setrlimit(Resource::RLIMIT_FSIZE, bytes.min(hard), hard).context("limiting files")
}

/// Has all writes of this process to files fail while the controls say so, for ever.
pub async fn follow(controls: Controls) {
    let mut full = false;
    loop {
        tokio::time::sleep(LOOK).await;
        if controls.is_full() != full {
            match limit(if full { RLIM_INFINITY } else { 0 }) {
                Ok(()) => full = !full,
                Err(error) => tracing::error!(%error, "could not change the limit of files"),
            }
        }
    }
}
