//! Watches of jobs over streams that may break.
//!
//! A restarted coordinator, or a lost connection, must not look like a failed job: the watch opens the stream again after the last sequence number it saw.

use super::{ClientError, YotoClient};
use std::time::{Duration, Instant};
use tonic::{Code, Status, Streaming};
use yoto_proto::v1::{Job, WatchJobRequest, WatchJobResponse, job};

/// Time limit of reconnection attempts.
pub(super) const GIVE_UP_AFTER: Duration = Duration::from_secs(60);
pub(super) const FIRST_PAUSE: Duration = Duration::from_millis(100);
pub(super) const LONGEST_PAUSE: Duration = Duration::from_secs(5);

/// The changes of one job, each delivered once and in order.
#[derive(Debug)]
pub struct JobWatch {
    client: YotoClient,
    name: String,
    stream: Option<Streaming<WatchJobResponse>>,
    after: u64,
    ended: bool,
}

impl JobWatch {
    pub(super) fn new(client: YotoClient, name: &str) -> Self {
        Self {
            client,
            name: name.to_owned(),
            stream: None,
            after: 0,
            ended: false,
        }
    }

    /// The next change; `None` after the job's terminal state.
    ///
    /// # Errors
    /// [`ClientError::Refused`] when the service refuses the watch, or can't be reached
    /// for a minute.
    pub async fn next(&mut self) -> Result<Option<Job>, ClientError> {
        if self.ended {
            return Ok(None);
        }
        let mut trouble: Option<(Instant, Duration)> = None;
        loop {
            let status = match self.receive().await {
                Ok(Some(job)) => {
                    self.after = job.sequence;
                    self.ended = is_terminal(job.state());
                    return Ok(Some(job));
                }
                Ok(None) => Status::unavailable("the watch ended before the job did"),
                Err(status) => status,
            };
            self.stream = None;
            let (since, pause) = trouble.unwrap_or_else(|| (Instant::now(), FIRST_PAUSE));
            if !is_transport(&status) || since.elapsed() > GIVE_UP_AFTER {
                return Err(ClientError::refused(format!("watching {}", self.name))(
                    status,
                ));
            }
            tracing::debug!(job = self.name, after = self.after, %status, "watch broke off; opening it again");
            tokio::time::sleep(pause).await;
            trouble = Some((since, (pause * 2).min(LONGEST_PAUSE)));
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

/// Whether `state` is terminal.
fn is_terminal(state: job::State) -> bool {
    matches!(
        state,
        job::State::Succeeded | job::State::Failed | job::State::Cancelled
    )
}

/// Whether the connection is at fault rather than the request.
pub(super) fn is_transport(status: &Status) -> bool {
    // A broken connection arrives as any of these, depending on how far the answer came.
    matches!(
        status.code(),
        Code::Unavailable | Code::Cancelled | Code::Unknown | Code::Internal | Code::Aborted
    )
}

#[cfg(test)]
mod tests;
