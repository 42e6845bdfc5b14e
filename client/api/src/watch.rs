//! Watches of jobs over streams that may break.
//!
//! A restarted coordinator, or a lost connection, must not look like a failed job: the watch opens the stream again
//! after the last sequence number it saw.

use super::retry::{FIRST_PAUSE, Retries};
use super::{ClientError, YotoClient};
use std::time::Duration;
use tonic::{Status, Streaming};
use yoto_proto::v1::{Job, WatchJobRequest, WatchJobResponse};

/// What a watch has to tell.
#[derive(Debug)]
pub enum JobChange {
    /// A change of the job.
    Job(Box<Job>),
    /// The service can't be reached; the watch keeps trying.
    Disconnected,
}

/// The changes of one job, each delivered once and in order.
#[derive(Debug)]
pub struct JobWatch {
    client: YotoClient,
    name: String,
    stream: Option<Streaming<WatchJobResponse>>,
    after: u64,
    ended: bool,
    retries: Retries,
    /// The pause before the next attempt, after a failure.
    pause: Option<Duration>,
}

impl JobWatch {
    pub(super) fn new(client: YotoClient, name: &str) -> Self {
        Self {
            client,
            name: name.to_owned(),
            stream: None,
            after: 0,
            ended: false,
            retries: Retries::new(),
            pause: None,
        }
    }

    /// The next change; `None` after the job's terminal state.
    ///
    /// # Errors
    /// [`ClientError::Refused`] when the service refuses the watch, or can't be reached
    /// for a minute.
    pub async fn next(&mut self) -> Result<Option<Job>, ClientError> {
        loop {
            match self.next_change().await? {
                Some(JobChange::Job(job)) => return Ok(Some(*job)),
                Some(JobChange::Disconnected) => {}
                None => return Ok(None),
            }
        }
    }

    /// As [`next`](Self::next), and reports a lost connection.
    ///
    /// # Errors
    /// As [`next`](Self::next).
    pub async fn next_change(&mut self) -> Result<Option<JobChange>, ClientError> {
        if self.ended {
            return Ok(None);
        }
        loop {
            if let Some(pause) = self.pause {
                tokio::time::sleep(pause).await;
            }
            let status = match self.receive().await {
                Ok(Some(job)) => {
                    self.retries.reset();
                    self.pause = None;
                    self.after = job.sequence;
                    self.ended = job.state().is_terminal();
                    return Ok(Some(JobChange::Job(Box::new(job))));
                }
                Ok(None) => Status::unavailable("the watch ended before the job did"),
                Err(status) => status,
            };
            self.stream = None;
            let Some(pause) = self.retries.pause(&status) else {
                return Err(ClientError::refused(format!("watching {}", self.name))(
                    status,
                ));
            };
            tracing::debug!(job = self.name, after = self.after, %status, "watch broke off; opening it again");
            self.pause = Some(pause.max(FIRST_PAUSE));
            // An idle connection may end a stream, so only the second failure counts.
            if self.retries.failures() == 2 {
                return Ok(Some(JobChange::Disconnected));
            }
        }
    }

    async fn receive(&mut self) -> Result<Option<Job>, Status> {
        let mut stream = match self.stream.take() {
            Some(stream) => stream,
            None => {
                let request = WatchJobRequest {
                    name: self.name.clone(),
                    after_sequence: self.after,
                };
                self.client
                    .job_service()
                    .watch_job(request)
                    .await?
                    .into_inner()
            }
        };
        let job = stream.message().await?.and_then(|answer| answer.job);
        self.stream = Some(stream);
        Ok(job)
    }
}

#[cfg(test)]
mod tests;
