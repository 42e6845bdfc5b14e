//! Watches of all jobs that match a filter: the open ones, then each change, resumable by what the caller knows.

use crate::context::Context;
use crate::notify::job_feed::{Change, subscribe};
use futures::{Stream, stream};
use prost::Message;
use std::collections::{HashMap, VecDeque};
use std::mem::take;
use std::sync::Arc;
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::{RecvError, TryRecvError};
use tokio_util::sync::CancellationToken;
use yoto_proto::limits::{LONGEST_PAGE_ENTRIES, PAGE_BYTES};
use yoto_proto::names::Collection;
use yoto_proto::v1::{Job, WatchJobsResponse, job};
use yoto_request::RequestError;
use yoto_store::{JobFilter, Page, StoreError, Tenant};

/// Most jobs of one response.
const BATCH: usize = 100;

struct Watcher {
    context: Arc<Context>,
    tenant: Tenant,
    filter: JobFilter,
    /// Sequence numbers that the caller knows, by `jobs/{id}`: of open jobs, and of those that ended in a gap.
    known: HashMap<String, u64>,
    /// `None` before the open jobs are read, for the first time or after a gap.
    changes: Option<Receiver<Change>>,
    /// What is read and not sent.
    waiting: VecDeque<WatchJobsResponse>,
    began: bool,
    stop: CancellationToken,
    ended: bool,
}

/// The tenant's open jobs of `filter` that are not in `known` with their sequence number, and the jobs of `known` that have ended;
/// then each change of a job of `filter`. The states of the filter are not looked at.
///
/// # Errors
/// The stream fails when the store fails, or `stop` is cancelled.
pub(crate) fn watch_all(
    context: Arc<Context>,
    tenant: Tenant,
    filter: JobFilter,
    known: HashMap<String, u64>,
    stop: CancellationToken,
) -> impl Stream<Item = Result<WatchJobsResponse, RequestError>> + Send + 'static {
    let watcher = Watcher {
        context,
        tenant,
        filter,
        known,
        changes: None,
        waiting: VecDeque::new(),
        began: false,
        stop,
        ended: false,
    };
    stream::unfold(watcher, |mut watcher| async move {
        if watcher.ended {
            return None;
        }
        let next = watcher.next().await;
        watcher.ended = next.is_err();
        Some((next, watcher))
    })
}

impl Watcher {
    async fn next(&mut self) -> Result<WatchJobsResponse, RequestError> {
        loop {
            if let Some(response) = self.waiting.pop_front() {
                return Ok(response);
            }
            let Some(changes) = &mut self.changes else {
                self.begin().await?;
                continue;
            };
            let change = tokio::select! {
                change = changes.recv() => change,
                () = self.stop.cancelled() => return Err(RequestError::ShuttingDown),
            };
            let mut batch = Batch::default();
            match change {
                Ok(change) => self.take(change, &mut batch),
                Err(RecvError::Lagged(_) | RecvError::Closed) => self.changes = None,
            }
            while batch.has_room()
                && let Some(changes) = &mut self.changes
            {
                match changes.try_recv() {
                    Ok(change) => self.take(change, &mut batch),
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Lagged(_) | TryRecvError::Closed) => self.changes = None,
                }
            }
            self.waiting.extend(batch.end());
        }
    }

    /// Reads the open jobs, and the known jobs that have ended.
    async fn begin(&mut self) -> Result<(), RequestError> {
        if self.stop.is_cancelled() {
            return Err(RequestError::ShuttingDown);
        }
        // Changes after this are in both, and are recognised by their sequence numbers.
        self.changes = Some(subscribe(&self.context.notifier, &self.tenant).await?);
        let mut gone = take(&mut self.known);
        let mut batch = Batch::default();
        for job in self.open().await? {
            let is_news = gone.remove(&job.name) != Some(job.sequence);
            self.known.insert(job.name.clone(), job.sequence);
            if is_news {
                batch.push(job);
            }
        }
        for (name, sequence) in gone {
            let id = Collection::Jobs.parse(&name).unwrap_or_default();
            match self.context.store.job_state(&self.tenant, id).await {
                Ok(job) if matches(&self.filter, &job) => {
                    self.known.insert(name, job.sequence);
                    if job.sequence != sequence {
                        batch.push(job);
                    }
                }
                Ok(_) => {}
                Err(StoreError::NotFound { .. }) => batch.deleted.push(name),
                Err(error) => return Err(error.into()),
            }
        }
        self.waiting.extend(batch.end());
        if self.waiting.is_empty() && !self.began {
            self.waiting.push_back(WatchJobsResponse::default());
        }
        self.began = true;
        Ok(())
    }

    /// The open jobs that match, newest first.
    async fn open(&self) -> Result<Vec<Job>, StoreError> {
        let filter = JobFilter {
            states: vec![job::State::Queued, job::State::Running],
            ..self.filter.clone()
        };
        let mut page = Page {
            limit: LONGEST_PAGE_ENTRIES,
            after: None,
        };
        let mut jobs = Vec::new();
        loop {
            let entries = self
                .context
                .store
                .jobs(&self.tenant, page, &filter, false)
                .await?;
            let Some(last) = entries.last() else {
                return Ok(jobs);
            };
            page.after = Some(last.position);
            jobs.extend(entries.into_iter().map(|it| it.item));
        }
    }

    /// Adds a change to `batch`, if it is one of the filter's jobs and news for the caller.
    fn take(&mut self, change: Change, batch: &mut Batch) {
        match change {
            Change::Job(job) if matches(&self.filter, &job) => {
                let known = self.known.get(&job.name);
                if known.is_some_and(|&known| known >= job.sequence) {
                    return;
                }
                match job.state().is_terminal() {
                    true => drop(self.known.remove(&job.name)),
                    false => drop(self.known.insert(job.name.clone(), job.sequence)),
                }
                batch.push(Job::clone(&job));
            }
            Change::Deleted(job) if self.known.remove(&job.name).is_some() => {
                batch.deleted.push(job.name.clone());
            }
            Change::Job(_) | Change::Deleted(_) => {}
        }
    }
}

/// Whether a job is one of the filter's, in whatever state.
fn matches(filter: &JobFilter, job: &Job) -> bool {
    let kinds = &filter.kinds;
    let model = filter.model_id.as_ref();
    (kinds.is_empty() || kinds.iter().any(|it| it.to_proto() == job.kind()))
        && model.is_none_or(|id| Collection::Models.name(id) == job.model)
        && filter.owner.as_ref().is_none_or(|it| *it == job.owner)
}

/// Responses of bounded length.
#[derive(Default)]
struct Batch {
    full: Vec<WatchJobsResponse>,
    jobs: Vec<Job>,
    bytes: usize,
    deleted: Vec<String>,
}

impl Batch {
    fn push(&mut self, job: Job) {
        let bytes = job.encoded_len();
        if self.jobs.len() >= BATCH || self.bytes + bytes > PAGE_BYTES && !self.jobs.is_empty() {
            self.full.push(WatchJobsResponse {
                jobs: take(&mut self.jobs),
                deleted: Vec::new(),
            });
            self.bytes = 0;
        }
        self.bytes += bytes;
        self.jobs.push(job);
    }

    fn has_room(&self) -> bool {
        self.full.is_empty() && self.deleted.len() < BATCH
    }

    fn end(mut self) -> Vec<WatchJobsResponse> {
        if !self.jobs.is_empty() || !self.deleted.is_empty() {
            self.full.push(WatchJobsResponse {
                jobs: self.jobs,
                deleted: self.deleted,
            });
        }
        self.full
    }
}
