//! Tells of changes of jobs: watchers of one job, watchers of all, workers that wait for one, other coordinators, and the sender of
//! traces.
//!
//! | here | who is told |
//! |---|---|
//! | [`changes`] | the watchers of one job |
//! | [`job_feed`] | the watchers of all jobs of a tenant |
//! | [`hints`] | waiting workers, and other coordinators of the database |
//! | [`ended`] | the sender of traces |
//!
//! Everything here only makes a change known sooner: whoever waits polls as well.

pub(crate) mod changes;
mod ended;
pub(crate) mod hints;
pub(crate) mod job_feed;

pub(crate) use ended::EndedJobs;

use crate::config::ServerConfig;
use changes::JobChanges;
use hints::{Hint, Hints};
use job_feed::JobFeed;
use std::sync::Arc;
use std::time::Duration;
use tokio_util::sync::CancellationToken;
use yoto_process::faults::Faults;
use yoto_store::{JobKind, Store, Tenant};

/// Who is to be told of changes of jobs.
#[derive(Debug)]
pub(crate) struct Notifier {
    store: Arc<Store>,
    changes: JobChanges,
    feed: JobFeed,
    hints: Hints,
    /// Jobs that have ended here, if their traces are sent.
    ended: Option<Arc<EndedJobs>>,
    /// The id of this coordinator among those of its database.
    instance: String,
    /// Interval between reads of watched jobs without hints.
    poll: Duration,
    /// The same while hints of other coordinators arrive.
    hinted_poll: Duration,
    faults: Option<Arc<dyn Faults>>,
    stop: CancellationToken,
}

impl Notifier {
    /// That of a coordinator called `instance`. Its watches end with `stop`.
    pub(crate) fn new(
        store: &Arc<Store>,
        config: &ServerConfig,
        instance: &str,
        ended: Option<Arc<EndedJobs>>,
        stop: &CancellationToken,
    ) -> Self {
        Self {
            store: Arc::clone(store),
            changes: JobChanges::default(),
            feed: JobFeed::default(),
            hints: Hints::new(config.hints && store.is_shared()),
            ended,
            instance: instance.to_owned(),
            poll: config.watch_poll,
            hinted_poll: config.hinted_poll,
            faults: config.faults.clone(),
            stop: stop.clone(),
        }
    }

    /// The job called `jobs/{id}` has changed: its watchers look at it, at each coordinator.
    pub(crate) fn announce(&self, job: &str) {
        self.changes.announce(job);
        self.hints.tell(Hint::Changed(job.to_owned()));
    }

    /// [`Self::announce`] for a job that has ended, or may have: a lease of it has.
    pub(crate) fn announce_end(&self, job: &str) {
        self.announce(job);
        if let Some(ended) = &self.ended {
            ended.note(job);
        }
    }

    /// A job of this kind waits for a worker: one that waits at this coordinator asks for it, and one at each other.
    pub(crate) fn queued(&self, tenant: &Tenant, kind: JobKind) {
        self.hints.waiting.wake(tenant, kind);
        self.hints.tell(Hint::queued(tenant, kind));
    }

    /// The hints for workers that wait.
    pub(crate) fn hints(&self) -> &Hints {
        &self.hints
    }

    /// Interval between reads of a watched job without announced changes.
    fn watch_poll(&self) -> Duration {
        match self.hints.are_heard() {
            true => self.hinted_poll,
            false => self.poll,
        }
    }
}
