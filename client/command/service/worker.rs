//! `yoto worker`: a worker in its own process, for a separate coordinator.

use crate::args::KindName;
use crate::service::serve::asked_to_stop;
use anyhow::Context;
use clap::Args;
use std::path::PathBuf;
use url::Url;
use yoto_client::endpoint;
use yoto_proto::v1::JobKind;
use yoto_worker::{Worker, WorkerConfig};

const AFTER_HELP: &str = "\
The worker pulls jobs from the service and reads and writes the object store by itself,
so it needs the service's address and the store's URL (`yoto serve` prints both). For s3:// it
reads AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY, AWS_REGION and AWS_ENDPOINT_URL, as the service does.

SIGTERM or ctrl-c: a training job saves a checkpoint and returns to the queue.

Examples:
  yoto serve --no-worker
  yoto worker --objects file:///srv/yoto/objects/
  yoto worker --server http://10.0.0.5:50051 --objects file:///mnt/yoto/objects/ --name gpu-1";

/// Run jobs for a service that runs in another process.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct WorkerCommand {
    #[command(flatten)]
    server: crate::args::Server,
    /// Object store of the service.
    #[arg(long, value_name = "URL")]
    objects: Url,
    /// Display name of this worker.
    #[arg(long, value_name = "NAME", default_value = "worker")]
    name: String,
    /// Kinds of jobs that it runs, separated by commas.
    #[arg(
        long,
        value_enum,
        value_delimiter = ',',
        value_name = "KIND",
        default_value = "ingest,train,render,evaluate,export"
    )]
    kinds: Vec<KindName>,
    /// Folder for the files of running jobs: uploads to read, checkpoints to load and save; created if
    /// missing.
    #[arg(long, value_name = "DIR", default_value = "./yoto-scratch")]
    scratch: PathBuf,
    #[command(flatten)]
    pub(crate) logs: crate::service::logs::LogArgs,
    #[command(flatten)]
    ingest: crate::args::IngestArgs,
    #[command(flatten)]
    lpips: crate::args::LpipsArgs,
}

impl WorkerCommand {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let channel = endpoint(&self.server.server)
            .with_context(|| format!("the service's address {}", self.server.server))?
            .connect_lazy();
        // Opening a GPU takes a while and may block.
        let picked = tokio::task::spawn_blocking(yoto_device::pick)
            .await
            .context("finding a device")?;
        tell!("computing on {}", picked.info.adapter);
        if let Some(hint) = yoto_device::hint_on_cpu() {
            tell!("{hint}");
        }
        let config = WorkerConfig {
            display_name: self.name,
            kinds: self.kinds.into_iter().map(JobKind::from).collect(),
            ingest: self.ingest.settings(),
            lpips: self.lpips.weights()?,
            scratch: self.scratch,
            after_job: crate::allocator::give_back_memory,
            ..WorkerConfig::default()
        };
        let worker = Worker::new(channel, &self.objects, picked, config)?;
        let stop = async {
            if let Err(error) = asked_to_stop().await {
                tracing::error!(%error, "can't listen for signals: stopping");
            }
        };
        worker.run(stop).await.context("working")
    }
}
