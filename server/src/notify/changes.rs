//! The watched jobs: each is read once for all of its watchers, at each announced change and at each poll.
//!
//! An announcement is only a [hint](super::hints): a job is polled as well, so a lost one only delays its watchers.

use super::Notifier;
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::{Notify, watch};
use yoto_proto::names::Collection;
use yoto_proto::v1::Job;
use yoto_store::{StoreError, Tenant};

/// What is known of a watched job.
#[derive(Debug, Clone)]
pub(crate) enum WatchedState {
    /// It was not read yet.
    Nothing,
    /// Its newest state, without its order.
    Job(Arc<Job>),
    /// It can't be read: each watcher reads it again to get the reason.
    Unreadable,
}

/// A watched job.
#[derive(Debug)]
struct Watched {
    changed: Arc<Notify>,
    seen: watch::Sender<WatchedState>,
}

/// The watched jobs, by `jobs/{id}`.
#[derive(Debug, Default)]
pub(crate) struct JobChanges {
    watched: Mutex<HashMap<String, Watched>>,
}

impl JobChanges {
    /// The job called `jobs/{id}` changed. Costs nothing while nobody watches it.
    pub(crate) fn announce(&self, job: &str) {
        if let Some(watched) = self.lock().get(job) {
            watched.changed.notify_one();
        }
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<String, Watched>> {
        self.watched.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The states of the tenant's job with this id, from now on. The caller has found that the tenant has it.
pub(crate) fn subscribe(
    notifier: &Arc<Notifier>,
    tenant: &Tenant,
    id: &str,
) -> watch::Receiver<WatchedState> {
    let mut watched = notifier.changes.lock();
    match watched.entry(Collection::Jobs.name(id)) {
        Entry::Occupied(entry) => entry.get().seen.subscribe(),
        Entry::Vacant(entry) => {
            let (seen, changed) = (
                watch::Sender::new(WatchedState::Nothing),
                Arc::<Notify>::default(),
            );
            let receiver = seen.subscribe();
            tokio::spawn(follow(
                notifier.clone(),
                tenant.clone(),
                id.to_owned(),
                changed.clone(),
            ));
            entry.insert(Watched { changed, seen });
            receiver
        }
    }
}

/// Reads a job at each change and at each poll, until nobody watches it.
async fn follow(notifier: Arc<Notifier>, tenant: Tenant, id: String, changed: Arc<Notify>) {
    let name = Collection::Jobs.name(&id);
    loop {
        let seen = match notifier.store.job_state(&tenant, &id).await {
            Ok(job) => Some(WatchedState::Job(Arc::new(job))),
            // The watch continues with the last known state.
            Err(StoreError::Unavailable { .. }) => None,
            Err(_) => Some(WatchedState::Unreadable),
        };
        if !told(&notifier.changes, &name, seen) {
            return;
        }
        tokio::select! {
            () = changed.notified() => {}
            () = tokio::time::sleep(notifier.watch_poll()) => {}
            () = notifier.stop.cancelled() => return,
        }
    }
}

/// Sends the state that was `seen`, if any and if it is new, to the watchers of a job. Returns false, and forgets the
/// job, once nobody watches it.
fn told(changes: &JobChanges, name: &str, seen: Option<WatchedState>) -> bool {
    let mut all = changes.lock();
    let Some(watched) = all.get(name) else {
        return false;
    };
    if watched.seen.receiver_count() == 0 {
        all.remove(name);
        return false;
    }
    let Some(seen) = seen else {
        return true;
    };
    watched.seen.send_if_modified(|last| {
        let news = match (&*last, &seen) {
            (WatchedState::Job(last), WatchedState::Job(job)) => last.sequence != job.sequence,
            _ => true,
        };
        if news {
            *last = seen;
        }
        news
    });
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_watch_survives_a_failed_read() {
        let (changes, seen) = (
            JobChanges::default(),
            watch::Sender::new(WatchedState::Nothing),
        );
        let watcher = seen.subscribe();
        let changed = Arc::<Notify>::default();
        let name = Collection::Jobs.name("1");
        changes
            .lock()
            .insert(name.clone(), Watched { changed, seen });
        assert!(told(&changes, &name, None), "it is still watched");
        assert!(!watcher.has_changed().expect("goes on"));
        assert!(told(&changes, &name, Some(WatchedState::Unreadable)));
        assert!(watcher.has_changed().expect("goes on"));
        drop(watcher);
        assert!(!told(&changes, &name, None), "nobody watches");
    }
}
