//! A hint that some job changed, so that watchers need not wait for their next poll.
//!
//! It is only a hint: watchers read the store, and poll it as well, so a lost hint (or a
//! change by another process) only delays them.

use tokio::sync::watch;

/// Wakes all watchers of jobs.
#[derive(Debug)]
pub struct JobChanges(watch::Sender<()>);

impl JobChanges {
    /// Without watchers.
    pub fn new() -> Self {
        Self(watch::Sender::new(()))
    }

    /// Some job changed.
    pub fn announce(&self) {
        self.0.send_replace(());
    }

    /// Wakes at each later change.
    pub fn subscribe(&self) -> watch::Receiver<()> {
        self.0.subscribe()
    }
}
