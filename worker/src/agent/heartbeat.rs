//! Lease renewals with the latest progress, until the lease is lost.

use super::answer;
use super::control::{JobControl, StopReason};
use crate::retry::is_stale_lease;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::watch;
use tokio::time::{sleep, timeout};
use tonic::Status;
use yoto_proto::key::Connection;
use yoto_proto::v1::Progress;
use yoto_proto::worker::v1::worker_service_client::WorkerServiceClient;
use yoto_proto::worker::v1::{Claim, HeartbeatRequest, HeartbeatResponse};

/// Renewals per lease: two may fail without harm.
const RENEWALS: u32 = 3;

/// The task that keeps one lease.
pub(super) struct Heartbeat {
    pub(super) client: WorkerServiceClient<Connection>,
    pub(super) claim: Claim,
    pub(super) control: Arc<JobControl>,
    pub(super) latest: watch::Receiver<Progress>,
    /// Shortest interval between two heartbeats.
    pub(super) every: Duration,
}

impl Heartbeat {
    /// Renews until the lease is lost. The job sees that in its [`JobControl`].
    pub(super) async fn keep(mut self, mut lease: Duration) {
        let mut answered = true;
        loop {
            self.wait(lease / RENEWALS, answered).await;
            let sent = Instant::now();
            let left = self.control.deadline().saturating_duration_since(sent);
            if left.is_zero() {
                return self.log("it expired before the coordinator could be reached");
            }
            // One unanswered call must leave time for another.
            answered = match timeout(left.min(lease / RENEWALS), self.renew()).await {
                Ok(Ok(renewed)) => {
                    // Measured from before the call, so it never exceeds the coordinator's lease.
                    lease = Duration::try_from_secs_f64(renewed.lease_seconds).unwrap_or(lease);
                    self.control.renew(sent + lease);
                    if renewed.cancel {
                        self.control.stop(StopReason::Cancelled);
                    }
                    true
                }
                Ok(Err(status)) if is_stale_lease(&status) => {
                    return self.lost(status.message());
                }
                Ok(Err(status)) => {
                    tracing::debug!(job = self.claim.job, %status, "a heartbeat failed, trying again");
                    false
                }
                Err(_) => false,
            };
        }
    }

    /// Waits for the next heartbeat: for new progress, but no longer than `longest`, and not
    /// at all for progress after one that failed.
    async fn wait(&mut self, longest: Duration, answered: bool) {
        let shortest = self.every.min(longest);
        sleep(shortest).await;
        if answered {
            // An error means that the job has ended and only its report remains.
            let _ = timeout(longest - shortest, self.latest.changed()).await;
        }
    }

    async fn renew(&mut self) -> Result<HeartbeatResponse, Status> {
        let request = HeartbeatRequest {
            claim: Some(self.claim.clone()),
            progress: Some(self.latest.borrow_and_update().clone()),
        };
        answer(self.client.heartbeat(request)).await
    }

    /// The coordinator has refused the lease.
    fn lost(&self, why: &str) {
        self.log(why);
        self.control.stop(StopReason::LeaseLost);
    }

    /// Logs why the lease has ended.
    fn log(&self, why: &str) {
        let (job, token) = (&self.claim.job, self.claim.token);
        // Once the job has ended, its accepted outcome ends the lease as well.
        if self.latest.has_changed().is_err() {
            tracing::debug!(job, token, why, "the lease has ended");
        } else {
            tracing::warn!(job, token, why, "the lease is lost");
        }
    }
}
