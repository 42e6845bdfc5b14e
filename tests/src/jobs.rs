//! Jobs that a test waits for.

use crate::process::PATIENCE;
use anyhow::{bail, ensure};
use std::time::{Duration, Instant};
use yoto_client::YotoClient;
use yoto_proto::v1::Job;

/// Interval between two looks at a job.
const LOOK: Duration = Duration::from_millis(20);

/// Reads the job `name` until it is `done`.
///
/// # Errors
/// When the job ends otherwise, is not done in time, or can't be read.
pub async fn until(
    client: &YotoClient,
    name: &str,
    what: &str,
    done: impl Fn(&Job) -> bool,
) -> anyhow::Result<Job> {
    let began = Instant::now();
    while began.elapsed() < 4 * PATIENCE {
        let job = client.get_job(name).await?;
        if done(&job) {
            return Ok(job);
        }
        ensure!(job.end_time.is_none(), "it ended before {what}: {job:?}");
        tokio::time::sleep(LOOK).await;
    }
    bail!("not in time: {what}")
}
