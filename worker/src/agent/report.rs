//! Reports a job's outcome, until the coordinator has received it.

use super::answer;
use super::ended::JobEnd;
use crate::jobs::JobFailure;
use crate::retry::{is_stale_lease, is_transient};
use std::time::Duration;
use tonic::Status;
use yoto_proto::backoff::Backoff;
use yoto_proto::key::Connection;
use yoto_proto::v1::JobResult;
use yoto_proto::worker::v1::end_job_request::Outcome;
use yoto_proto::worker::v1::worker_service_client::WorkerServiceClient;
use yoto_proto::worker::v1::{Claim, EndJobRequest};

/// Delivers `outcome`. Returns the end of the lease once the coordinator accepts it, or reports that the lease is lost;
/// retries while the connection is broken. The caller limits it.
pub(super) async fn report(
    client: WorkerServiceClient<Connection>,
    claim: &Claim,
    outcome: Result<JobResult, JobFailure>,
) -> JobEnd {
    let failure = match outcome {
        Ok(result) => match deliver(&client, claim, Outcome::Succeeded(result)).await {
            Ok(()) => return JobEnd::Succeeded,
            Err(status) if is_stale_lease(&status) => return superseded(claim, &status),
            Err(status) => {
                JobFailure::failed("INTERNAL", "the coordinator refused the result", &status)
            }
        },
        Err(failure) => failure,
    };
    let end = JobEnd::of(&failure);
    let Some(outcome) = failure.into_outcome() else {
        return end;
    };
    match deliver(&client, claim, outcome).await {
        Ok(()) => end,
        Err(status) => superseded(claim, &status),
    }
}

/// Calls until there is a definite answer.
async fn deliver(
    client: &WorkerServiceClient<Connection>,
    claim: &Claim,
    outcome: Outcome,
) -> Result<(), Status> {
    let request = EndJobRequest {
        claim: Some(claim.clone()),
        outcome: Some(outcome),
    };
    let mut backoff = Backoff::new(Duration::from_millis(200), Duration::from_secs(2));
    loop {
        let mut client = client.clone();
        match answer(client.end_job(request.clone())).await {
            Err(status) if is_transient(status.code()) => {
                tracing::debug!(%status, "reporting a job's end failed, trying again");
                tokio::time::sleep(backoff.pause()).await;
            }
            answered => return answered.map(drop),
        }
    }
}

/// The coordinator has refused the outcome: the job is no longer this worker's.
fn superseded(claim: &Claim, status: &Status) -> JobEnd {
    let (job, token) = (&claim.job, claim.token);
    tracing::warn!(job, token, %status, "the coordinator does not accept the job's outcome");
    JobEnd::Returned
}
