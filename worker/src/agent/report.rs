//! Reports a job's outcome, until the coordinator has received it.

use super::answer;
use crate::{
    jobs::JobFailure,
    retry::{Backoff, is_stale_lease, is_transient},
};
use std::{future::Future, time::Duration};
use tonic::{Status, transport::Channel};
use yoto_proto::v1::{CompleteJobRequest, JobResult, worker_service_client::WorkerServiceClient};

/// Delivers `outcome`. Returns once the coordinator accepts it, or reports that the lease is lost;
/// retries while the connection is broken. The caller limits it to the lease.
pub(super) async fn report(
    client: WorkerServiceClient<Channel>,
    job: &str,
    token: u64,
    outcome: Result<JobResult, JobFailure>,
) {
    let failure = match outcome {
        Ok(result) => {
            let request = CompleteJobRequest {
                job: job.into(),
                token,
                result: Some(result),
            };
            let refused = deliver(|| {
                let (mut client, request) = (client.clone(), request.clone());
                async move { answer(client.complete_job(request)).await.map(drop) }
            })
            .await;
            match refused {
                Ok(()) => return,
                Err(status) if is_stale_lease(status.code()) => {
                    return superseded(job, token, &status);
                }
                Err(status) => {
                    JobFailure::failed("INTERNAL", "the coordinator refused the result", &status)
                }
            }
        }
        Err(failure) => failure,
    };
    let Some(request) = failure.into_request(job, token) else {
        return;
    };
    let refused = deliver(|| {
        let (mut client, request) = (client.clone(), request.clone());
        async move { answer(client.fail_job(request)).await.map(drop) }
    })
    .await;
    if let Err(status) = refused {
        superseded(job, token, &status);
    }
}

/// Calls until there is a definite answer.
async fn deliver<F>(mut call: impl FnMut() -> F) -> Result<(), Status>
where
    F: Future<Output = Result<(), Status>>,
{
    let mut backoff = Backoff::new(Duration::from_millis(200), Duration::from_secs(2));
    loop {
        match call().await {
            Err(status) if is_transient(status.code()) => {
                tracing::debug!(%status, "reporting a job's end failed, trying again");
                tokio::time::sleep(backoff.pause()).await;
            }
            answered => return answered,
        }
    }
}

fn superseded(job: &str, token: u64, status: &Status) {
    tracing::warn!(job, token, %status, "the coordinator does not accept the job's outcome");
}
