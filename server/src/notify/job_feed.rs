//! The changes of all jobs of a tenant, for [`crate::jobs::watch_all`]: read once at each poll for all of its watchers, and only
//! while there are any.

use super::Notifier;
use std::collections::{HashMap, HashSet};
use std::sync::Arc;
use tokio::sync::{Mutex, broadcast};
use yoto_proto::v1::Job;
use yoto_store::{JobVersion, JobVersions, StoreError, Tenant};

/// Changes that a slow watcher may lag behind; one that lags further reads all open jobs again.
const CHANGES: usize = 1024;

/// A change of a job, which comes without its order.
#[derive(Debug, Clone)]
pub(crate) enum Change {
    /// The new state.
    Job(Arc<Job>),
    /// The last known state of an open job that ended and was deleted since the last poll.
    Deleted(Arc<Job>),
}

/// Sends the changes of each tenant's jobs to its watchers. A tenant without watchers has no sender.
#[derive(Debug, Default)]
pub(crate) struct JobFeed {
    senders: Mutex<HashMap<Tenant, broadcast::Sender<Change>>>,
}

/// All changes of the tenant's jobs from now on: each after the reading with which this call began.
///
/// # Errors
/// When the store fails.
pub(crate) async fn subscribe(
    notifier: &Arc<Notifier>,
    tenant: &Tenant,
) -> Result<broadcast::Receiver<Change>, StoreError> {
    let mut senders = notifier.feed.senders.lock().await;
    if let Some(sender) = senders.get(tenant) {
        return Ok(sender.subscribe());
    }
    // The first reading comes before the watcher's own: otherwise a change between the two would be lost.
    let mut open = Open::of(tenant.clone());
    open.read(notifier).await?;
    let (new, receiver) = broadcast::channel(CHANGES);
    tokio::spawn(follow(Arc::clone(notifier), new.clone(), open));
    senders.insert(tenant.clone(), new);
    Ok(receiver)
}

/// Reads the jobs at each poll, until nobody watches or the store is broken. Watchers then subscribe again, and get the
/// reason.
async fn follow(notifier: Arc<Notifier>, sender: broadcast::Sender<Change>, mut open: Open) {
    loop {
        tokio::select! {
            () = tokio::time::sleep(notifier.poll) => {}
            () = notifier.stop.cancelled() => break,
        }
        let mut senders = notifier.feed.senders.lock().await;
        if sender.receiver_count() == 0 {
            senders.remove(&open.tenant);
            return;
        }
        drop(senders);
        match open.read(&notifier).await {
            // Nobody may listen by now.
            Ok(changes) => changes
                .into_iter()
                .for_each(|change| drop(sender.send(change))),
            Err(StoreError::Unavailable { .. }) => {}
            Err(error) => {
                tracing::error!(%error, "could not read the watched jobs");
                break;
            }
        }
    }
    notifier.feed.senders.lock().await.remove(&open.tenant);
}

/// A tenant's open jobs of the last reading.
#[derive(Debug)]
struct Open {
    tenant: Tenant,
    jobs: HashMap<String, Arc<Job>>,
    /// Sequence numbers of ended jobs that the next reading may find again.
    ended: HashMap<String, u64>,
    /// Position of the newest job; `None` before the first reading.
    newest: Option<i64>,
}

impl Open {
    /// Nothing, before the first reading.
    fn of(tenant: Tenant) -> Self {
        Self {
            tenant,
            jobs: HashMap::new(),
            ended: HashMap::new(),
            newest: None,
        }
    }

    /// The changes since the last reading. A job of which the reading fails keeps its last state, so that the next reading
    /// finds its change again.
    async fn read(&mut self, notifier: &Notifier) -> Result<Vec<Change>, StoreError> {
        let JobVersions { newest, jobs } = notifier
            .store
            .job_versions(&self.tenant, self.newest)
            .await?;
        let mut changes = Vec::new();
        let mut seen = HashSet::with_capacity(jobs.len());
        for JobVersion {
            id,
            sequence,
            is_open,
        } in jobs
        {
            match self.newest {
                // It ended before anybody watched.
                None if !is_open => drop(self.ended.insert(id.clone(), sequence)),
                _ if self.sequence(&id) != Some(sequence) => {
                    self.update(notifier, &id, &mut changes).await?;
                }
                _ => {}
            }
            seen.insert(id);
        }
        self.ended.retain(|id, _| seen.contains(id));
        let gone: Vec<String> = self.jobs.keys().cloned().collect();
        for id in gone.into_iter().filter(|id| !seen.contains(id)) {
            self.update(notifier, &id, &mut changes).await?;
        }
        self.newest = Some(newest);
        Ok(changes)
    }

    /// The sequence number of a job's last known state.
    fn sequence(&self, id: &str) -> Option<u64> {
        let open = self.jobs.get(id).map(|it| it.sequence);
        open.or_else(|| self.ended.get(id).copied())
    }

    async fn update(
        &mut self,
        notifier: &Notifier,
        id: &str,
        changes: &mut Vec<Change>,
    ) -> Result<(), StoreError> {
        match notifier.store.job_state(&self.tenant, id).await {
            Ok(job) => {
                let job = Arc::new(job);
                if job.state().is_terminal() {
                    self.jobs.remove(id);
                    self.ended.insert(id.to_owned(), job.sequence);
                } else {
                    self.jobs.insert(id.to_owned(), Arc::clone(&job));
                }
                changes.push(Change::Job(job));
            }
            Err(StoreError::NotFound { .. }) => {
                let last = self.jobs.remove(id);
                changes.extend(last.map(Change::Deleted));
            }
            Err(error) => return Err(error),
        }
        Ok(())
    }
}
