//! A training, followed to its end.

use anyhow::bail;
use yoto_client::YotoClient;
use yoto_proto::v1::{Job, TrainResult, TrainSpec, job_result};
use yoto_terminal::progress::{ProgressDisplay, duration};

/// Runs one training and shows its progress under `label`; `on_change` receives each state of the job.
///
/// # Errors
/// When the job fails.
pub(crate) async fn train(
    client: &YotoClient,
    label: &str,
    spec: TrainSpec,
    mut on_change: impl FnMut(&Job),
) -> anyhow::Result<TrainResult> {
    let job = client.train(spec).await?;
    let mut display = ProgressDisplay::new(label);
    let job = client
        .wait_for_job(&job.name, |job| {
            display.job(job);
            on_change(job);
        })
        .await?;
    match job.result.and_then(|result| result.kind) {
        Some(job_result::Kind::Train(result)) => {
            display.finish(&format!(
                "trained, {} steps in {}",
                result.steps,
                duration(result.train_seconds)
            ));
            Ok(result)
        }
        _ => bail!("{} succeeded without a training result", job.name),
    }
}
