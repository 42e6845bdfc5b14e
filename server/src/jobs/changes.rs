//! A hint that some job changed, so that watchers need not wait for their next poll.
//!
//! It is a hint only: watchers read the store, and poll it besides, so a lost hint (or a
//! change by another process) costs a moment and nothing else.

use tokio::sync::watch;

/// Wakes everyone who watches a job.
#[derive(Debug)]
pub struct JobChanges(watch::Sender<()>);

impl JobChanges {
    /// Nobody watches yet.
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
