//! A hint that a job changed, so that its watchers need not wait for their next poll.
//!
//! It is only a hint: watchers read the store, and poll it as well, so a lost hint (or a
//! change by another process) only delays them.

use std::{
    collections::HashMap,
    sync::{Mutex, PoisonError},
};
use tokio::sync::watch;

/// Wakes the watchers of a job.
#[derive(Debug, Default)]
pub struct JobChanges {
    /// Of the jobs that somebody watches, by `jobs/{id}`.
    watched: Mutex<HashMap<String, watch::Sender<()>>>,
}

impl JobChanges {
    /// The job called `jobs/{id}` changed. Costs nothing while nobody watches it.
    pub fn announce(&self, job: &str) {
        let mut watched = self.watched.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(changes) = watched.get(job)
            && changes.send(()).is_err()
        {
            watched.remove(job);
        }
    }

    /// Wakes at each later change of the job called `jobs/{id}`.
    pub fn subscribe(&self, job: &str) -> watch::Receiver<()> {
        let mut watched = self.watched.lock().unwrap_or_else(PoisonError::into_inner);
        // Those whose watchers are gone, and whose jobs never change again.
        watched.retain(|_, changes| changes.receiver_count() > 0);
        let changes = watched.entry(job.to_owned());
        changes
            .or_insert_with(|| watch::Sender::new(()))
            .subscribe()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_watchers_of_the_changed_job_wake() {
        let changes = JobChanges::default();
        let (a, b) = (changes.subscribe("jobs/a"), changes.subscribe("jobs/b"));
        changes.announce("jobs/a");
        assert!(a.has_changed().expect("is open"));
        assert!(!b.has_changed().expect("is open"));
        drop((a, b));
        changes.announce("jobs/a");
        assert!(!changes.subscribe("jobs/c").has_changed().expect("is open"));
        let watched = changes.watched.lock().expect("no panic");
        assert_eq!(watched.keys().collect::<Vec<_>>(), ["jobs/c"]);
    }
}
