//! `yoto worker`: runs jobs in a process of its own.

mod cordon;
#[cfg(feature = "embedded")]
mod needs;
#[cfg(feature = "embedded")]
mod run;

use clap::Args;
use cordon::Action;
#[cfg(feature = "embedded")]
use run::WorkerArgs;
use std::process::ExitCode;

const AFTER_HELP: &str = "\
The worker pulls jobs from the service and reads and writes the object store by itself,
so it needs the service's address and the store's URL (`yoto serve` prints both). Of several
addresses with commas between them, or of a name with several machines, it uses one and moves to the
next when that does not answer.

SIGTERM or ctrl-c: a training job saves a checkpoint and returns to the queue, other jobs return at
once, and the process ends within --notice.

With --one-job, the exit status is 0 after a job that succeeded or was cancelled, 3 without a job, 4
after a job that failed, and 5 after one that went back to the queue. It is 1 if the worker can't work.

Examples:
  yoto serve --no-worker
  yoto worker --objects file:///srv/yoto/objects/
  yoto worker --service http://10.0.0.5:50051 --objects file:///mnt/yoto/objects/ --name gpu-1
  yoto worker cordon gpu-1
  yoto worker --service http://a:50051,http://b:50051 --needs gpu --one-job --max-idle 60 --notice 30";

/// Run jobs for a service that runs in another process; keep jobs away from a worker.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
#[cfg_attr(feature = "embedded", command(args_conflicts_with_subcommands = true))]
pub(crate) struct WorkerCommand {
    #[cfg(feature = "embedded")]
    #[command(subcommand)]
    action: Option<Action>,
    #[cfg(not(feature = "embedded"))]
    #[command(subcommand)]
    action: Action,
    #[cfg(feature = "embedded")]
    #[command(flatten)]
    pub(crate) worker: WorkerArgs,
}

impl WorkerCommand {
    #[cfg(feature = "embedded")]
    pub(crate) async fn run(self) -> anyhow::Result<ExitCode> {
        match self.action {
            Some(action) => action.run().await.map(|()| ExitCode::SUCCESS),
            None => self.worker.run().await,
        }
    }

    #[cfg(not(feature = "embedded"))]
    pub(crate) async fn run(self) -> anyhow::Result<ExitCode> {
        self.action.run().await.map(|()| ExitCode::SUCCESS)
    }
}
