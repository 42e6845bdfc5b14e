//! Watches of all jobs over streams that may break: after a break, the service sends what this watch does not know.

use super::retry::{FIRST_PAUSE, Retries};
use super::{ClientError, YotoClient};
use std::collections::HashMap;
use std::time::Duration;
use tonic::{Status, Streaming};
use yoto_proto::limits::LONGEST_PAGE_ENTRIES;
use yoto_proto::v1::{Job, JobKind, KnownJob, WatchJobsRequest, WatchJobsResponse};

/// Which jobs to watch.
#[derive(Debug, Clone, Default)]
pub struct JobsFilter {
    /// Their kinds; empty: all.
    pub kinds: Vec<JobKind>,
    /// Their `models/{id}`; empty: of all.
    pub model: String,
    /// Their owner; empty: of all.
    pub owner: String,
}

/// What a watch of all jobs has to tell.
#[derive(Debug)]
pub enum JobsChange {
    /// Jobs that have changed, without their orders, and names of jobs that were deleted before their end was seen. The
    /// first change has the open jobs, or none.
    Changed {
        /// The new states.
        jobs: Vec<Job>,
        /// `jobs/{id}`.
        deleted: Vec<String>,
    },
    /// The service can't be reached; the watch keeps trying.
    Disconnected,
}

/// The changes of all jobs that match a filter; without an end of its own.
#[derive(Debug)]
pub struct JobsWatch {
    client: YotoClient,
    filter: JobsFilter,
    stream: Option<Streaming<WatchJobsResponse>>,
    /// Sequence numbers of the open jobs, by name.
    open: HashMap<String, u64>,
    retries: Retries,
    /// The pause before the next attempt, after a failure.
    pause: Option<Duration>,
}

impl YotoClient {
    /// Follows all jobs that match `filter`: the open ones, and those that are queued later.
    pub fn watch_jobs(&self, filter: JobsFilter) -> JobsWatch {
        JobsWatch {
            client: self.clone(),
            filter,
            stream: None,
            open: HashMap::new(),
            retries: Retries::new(),
            pause: None,
        }
    }
}

impl JobsWatch {
    /// Number of jobs that are open as far as this watch knows.
    pub fn open(&self) -> usize {
        self.open.len()
    }

    /// The next changes.
    ///
    /// # Errors
    /// [`ClientError::Refused`] when the service refuses the watch, or can't be reached for a minute.
    pub async fn next_change(&mut self) -> Result<JobsChange, ClientError> {
        loop {
            if let Some(pause) = self.pause {
                tokio::time::sleep(pause).await;
            }
            let status = match self.receive().await {
                Ok(Some(answer)) => {
                    self.retries.reset();
                    self.pause = None;
                    return Ok(self.seen(answer));
                }
                Ok(None) => Status::unavailable("the watch ended"),
                Err(status) => status,
            };
            self.stream = None;
            let Some(pause) = self.retries.pause(&status) else {
                return Err(ClientError::refused("watching jobs")(status));
            };
            tracing::debug!(%status, "the watch of all jobs broke off; opening it again");
            self.pause = Some(pause.max(FIRST_PAUSE));
            // An idle connection may end a stream, so only the second failure counts.
            if self.retries.failures() == 2 {
                return Ok(JobsChange::Disconnected);
            }
        }
    }

    fn seen(&mut self, answer: WatchJobsResponse) -> JobsChange {
        let WatchJobsResponse { jobs, deleted } = answer;
        for job in &jobs {
            match job.state().is_terminal() {
                true => self.open.remove(&job.name),
                false => self.open.insert(job.name.clone(), job.sequence),
            };
        }
        for name in &deleted {
            self.open.remove(name);
        }
        JobsChange::Changed { jobs, deleted }
    }

    async fn receive(&mut self) -> Result<Option<WatchJobsResponse>, Status> {
        let mut stream = match self.stream.take() {
            Some(stream) => stream,
            None => {
                // The service sends further jobs again if they are still open.
                let further = self.open.keys().skip(LONGEST_PAGE_ENTRIES as usize);
                for name in further.cloned().collect::<Vec<_>>() {
                    self.open.remove(&name);
                }
                let known = self.open.iter();
                let request = WatchJobsRequest {
                    kinds: self.filter.kinds.iter().map(|&it| it.into()).collect(),
                    model: self.filter.model.clone(),
                    owner: self.filter.owner.clone(),
                    known: known
                        .map(|(name, &sequence)| KnownJob {
                            name: name.clone(),
                            sequence,
                        })
                        .collect(),
                };
                let mut service = self.client.job_service();
                service.watch_jobs(request).await?.into_inner()
            }
        };
        let answer = stream.message().await?;
        self.stream = Some(stream);
        Ok(answer)
    }
}
