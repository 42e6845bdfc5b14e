//! `yoto worker`: a worker in its own process, for a separate coordinator.

use super::needs::{self, Needs};
use crate::args::KindName;
use crate::service::signals::asked_to_stop;
use anyhow::Context;
use clap::Args;
use std::path::PathBuf;
use std::process::ExitCode;
use url::Url;
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_proto::v1::JobKind;
use yoto_worker::{Ended, JobEnd, Worker, WorkerConfig};

/// Exit status of `--one-job` without a job.
const NOTHING_TO_DO: u8 = 3;
/// Exit status of `--one-job` whose job FAILED.
const JOB_FAILED: u8 = 4;
/// Exit status of `--one-job` whose job is in the queue again, or with another worker.
const JOB_RETURNED: u8 = 5;

/// Options of a worker's process.
#[derive(Debug, Args)]
pub(crate) struct WorkerArgs {
    #[command(flatten)]
    server: crate::args::Server,
    /// Object store of the service.
    #[arg(long, env = "YOTO_OBJECTS", value_name = "URL")]
    objects: Option<Url>,
    /// Display name of this worker.
    #[arg(
        long,
        env = "YOTO_WORKER_NAME",
        value_name = "NAME",
        default_value = "worker"
    )]
    name: String,
    /// Kinds of jobs that the worker runs, separated by commas [default: all that --needs allows].
    #[arg(long, value_enum, value_delimiter = ',', value_name = "KIND")]
    kinds: Vec<KindName>,
    /// Take only jobs that compute on a GPU (and refuse to start without one), or only jobs that need none.
    #[arg(long, value_enum, value_name = "DEVICE")]
    needs: Option<Needs>,
    /// Take one job and end. Without --max-idle, end at once if no job waits.
    #[arg(long)]
    one_job: bool,
    /// End after this time without a job, seconds.
    #[arg(long, value_name = "SECONDS", value_parser = crate::args::seconds)]
    max_idle: Option<f64>,
    /// Time from SIGTERM until this process has ended, seconds: a training saves, other jobs return to the
    /// queue at once.
    #[arg(long, value_name = "SECONDS", default_value_t = 15.0, value_parser = crate::args::seconds)]
    notice: f64,
    /// Folder for the files of running jobs: uploads to read, checkpoints to load and save; created if
    /// missing.
    #[arg(
        long,
        env = "YOTO_SCRATCH",
        value_name = "DIR",
        default_value = "./yoto-scratch"
    )]
    scratch: PathBuf,
    #[command(flatten)]
    pub(crate) logs: crate::service::logs::LogArgs,
    #[command(flatten)]
    ingest: crate::args::IngestArgs,
    #[command(flatten)]
    lpips: yoto_terminal::args::LpipsArgs,
}

impl WorkerArgs {
    pub(super) async fn run(self) -> anyhow::Result<ExitCode> {
        let objects = self.objects.context(
            "--objects is missing: the service's object store, whose URL `yoto serve` prints",
        )?;
        let given = self.kinds.into_iter().map(JobKind::from).collect();
        let kinds = needs::kinds(self.needs, given)?;
        let service = self.server.addresses()?;
        let key = self.server.key()?;
        // Opening a GPU takes a while and may block.
        let needs = self.needs;
        let picked = tokio::task::spawn_blocking(move || needs::pick(needs))
            .await
            .context("finding a device")??;
        tell!("computing on {}", picked.info.adapter);
        if self.needs.is_none()
            && let Some(hint) = yoto_device::hint_on_cpu()
        {
            tell!("{hint}");
        }
        let config = WorkerConfig {
            display_name: self.name,
            kinds,
            one_job: self.one_job,
            max_idle_seconds: self.max_idle,
            ingest: self.ingest.settings()?,
            lpips: self.lpips.weights(LpipsWeights::both)?,
            scratch: self.scratch,
            key,
            after_job: crate::allocator::give_back_memory,
            ..WorkerConfig::default()
        };
        let config = config.with_notice(self.notice);
        let worker = Worker::new(service.connect_lazy(), &objects, picked, config)?;
        let stop = async {
            if let Err(error) = asked_to_stop().await {
                tracing::error!(%error, "can't listen for signals: stopping");
            }
        };
        let ended = worker.run(stop).await.context("working")?;
        let (code, told) = status(ended, self.one_job);
        tell!("{told}");
        Ok(ExitCode::from(code))
    }
}

/// The exit status for an end, and a sentence.
fn status(ended: Ended, one_job: bool) -> (u8, &'static str) {
    match ended {
        Ended::Stopped => (0, "the worker was stopped"),
        Ended::Idle if one_job => (NOTHING_TO_DO, "there is no job for this worker"),
        Ended::Idle => (0, "no job came: the worker ends"),
        Ended::OneJob(JobEnd::Succeeded) => (0, "the job succeeded"),
        Ended::OneJob(JobEnd::Cancelled) => (0, "the job was cancelled"),
        Ended::OneJob(JobEnd::Failed) => (JOB_FAILED, "the job failed: `yoto job show` says why"),
        Ended::OneJob(JobEnd::Returned) => {
            (JOB_RETURNED, "the job no longer belongs to this worker")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ends_of_one_job_have_statuses_of_their_own() {
        let code = |ended| status(ended, true).0;
        let ends = [
            code(Ended::OneJob(JobEnd::Succeeded)),
            code(Ended::Idle),
            code(Ended::OneJob(JobEnd::Failed)),
            code(Ended::OneJob(JobEnd::Returned)),
        ];
        assert_eq!(ends, [0, 3, 4, 5]);
        assert_eq!(status(Ended::Idle, false).0, 0);
    }
}
