//! Coordinator and worker in this process, with the same gRPC as over a network.
//!
//! The workers and this process's own client use an in-memory stream; other clients may use TCP. There are
//! two workers, a lane for trainings and one for everything else, so that a render or an upload does not
//! wait for the end of a training. Their tensor operations share one pool with a thread per core, into which
//! each lane puts small pieces of work in turn: a render beside a training takes about half of the cores.
//! A shutdown has a time limit, regardless of jobs and clients: first the network and the worker
//! (a running job saves and returns to the queue), then the coordinator, which the worker needs
//! until it has returned its job.

mod error;
mod parts;

pub use error::EmbeddedError;
use parts::{Outcome, ended_early, joined};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;
use url::Url;
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_client::YotoClient;
use yoto_device::PickedDevice;
use yoto_ingest::IngestSettings;
use yoto_proto::v1::JobKind;
use yoto_server::{
    Admission, Certificates, Coordinator, InMemoryConnector, InMemoryIncoming, ServerConfig,
    ServerError, TlsFiles, in_memory,
};
use yoto_worker::{Worker, WorkerConfig, WorkerError};

/// Time limit of the worker to save and return its job.
const WORKER_DRAIN: Duration = Duration::from_secs(10);
/// Time limit of open calls.
const SERVER_GRACE: Duration = Duration::from_secs(3);
/// The worker's folder for files of running jobs, in the data folder.
const SCRATCH_FOLDER: &str = "scratch";
/// Time after each limit until the part is stopped by force.
const SLACK: Duration = Duration::from_secs(5);

/// Settings of the embedded service.
#[derive(Debug, Clone)]
pub struct EmbeddedOptions {
    /// The coordinator's settings. Its limit of a shutdown is always 3 seconds, since the process waits for it.
    pub server: ServerConfig,
    /// Address for clients of other processes, if any.
    pub listen: Option<SocketAddr>,
    /// Callers whom the address admits without a key.
    pub admission: Admission,
    /// Certificates of the address, which is encrypted with them.
    pub tls: Option<TlsFiles>,
    /// Whether to run jobs in this process.
    pub worker: bool,
    /// The worker's settings for reading uploads. By default it starts this program again, which must
    /// call [`yoto_ingest::become_ingest_child_if_asked`] before anything else.
    pub ingest: IngestSettings,
    /// Weights of the networks of LPIPS, if present.
    pub lpips: Option<LpipsWeights>,
    /// Where the files of a running job are; by default a folder in the data folder, which is emptied first.
    pub scratch: Option<PathBuf>,
    /// Time from the start of a shutdown until calls are refused. Health says meanwhile that nobody should come.
    pub drain: Duration,
}

impl EmbeddedOptions {
    /// A coordinator with these settings and a worker, for the clients of this process alone.
    pub fn new(server: ServerConfig) -> Self {
        Self {
            server,
            listen: None,
            admission: Admission::Machine,
            tls: None,
            worker: true,
            ingest: IngestSettings::default(),
            lpips: None,
            scratch: None,
            drain: Duration::ZERO,
        }
    }
}

/// A running service.
#[derive(Debug)]
pub struct Embedded {
    connector: InMemoryConnector,
    address: Option<SocketAddr>,
    objects: Url,
    device: String,
    /// Ends the network side and the worker.
    drain: CancellationToken,
    /// Ends the in-memory side, which the worker needs while it drains.
    stop: CancellationToken,
    /// Time from the first to the end of the network side.
    drain_time: Duration,
    coordinator: Option<JoinHandle<Outcome<ServerError>>>,
    /// The lane for trainings.
    trainer: Option<JoinHandle<Outcome<WorkerError>>>,
    /// The lane for everything else.
    worker: Option<JoinHandle<Outcome<WorkerError>>>,
}

impl Embedded {
    /// Opens the data folder and starts serving and working.
    ///
    /// # Errors
    /// When the folder is in use or unusable, or the address can't be listened at.
    pub async fn start(options: EmbeddedOptions) -> Result<Self, EmbeddedError> {
        // Before the address is taken, so that a wrong file is not reported as a fault of the address.
        let certificates = options.tls.map(Certificates::load).transpose()?;
        let listener = match options.listen {
            Some(address) => Some(
                TcpListener::bind(address)
                    .await
                    .map_err(|source| EmbeddedError::Listen { address, source })?,
            ),
            None => None,
        };
        let address = listener
            .as_ref()
            .and_then(|listener| listener.local_addr().ok());
        let data = options.server.data_dir.clone();
        let config = ServerConfig {
            shutdown_grace: SERVER_GRACE,
            ..options.server
        };
        let coordinator = Coordinator::open(config).await?;
        let objects = coordinator.objects_url().clone();
        let (connector, incoming) = in_memory();
        let (drain, stop) = (CancellationToken::new(), CancellationToken::new());
        let mut embedded = Self {
            coordinator: Some(tokio::spawn(coordinate(
                coordinator,
                incoming,
                listener.map(|it| (it, certificates, options.admission)),
                drain.clone(),
                options.drain,
                stop.clone(),
            ))),
            trainer: None,
            worker: None,
            connector,
            address,
            objects: objects.clone(),
            device: "no device: this process only coordinates".to_owned(),
            drain,
            stop,
            drain_time: options.drain,
        };
        if options.worker {
            let picked = pick_device().await?;
            embedded.device.clone_from(&picked.info.adapter);
            let scratch = match options.scratch {
                Some(folder) => folder,
                None => emptied(data.join(SCRATCH_FOLDER))?,
            };
            let config = |name: &str, kinds: &[JobKind]| WorkerConfig {
                display_name: name.into(),
                kinds: kinds.to_vec(),
                embedded: true,
                scratch: scratch.clone(),
                // Polling is cheap within one process.
                idle_poll_seconds: 0.25,
                drain_seconds: WORKER_DRAIN.as_secs_f64(),
                ingest: options.ingest.clone(),
                lpips: options.lpips.clone(),
                after_job: crate::allocator::give_back_memory,
                ..WorkerConfig::default()
            };
            let trainer = config("embedded trainer", &[JobKind::Train]);
            embedded.trainer = Some(embedded.lane(picked.clone(), trainer)?);
            let others = [
                JobKind::Ingest,
                JobKind::Render,
                JobKind::Evaluate,
                JobKind::Export,
            ];
            let others = config("embedded", &others);
            embedded.worker = Some(embedded.lane(picked, others)?);
        }
        Ok(embedded)
    }

    /// Starts a worker on a thread of its own: heartbeats must not wait for a busy coordinator.
    fn lane(
        &self,
        device: PickedDevice,
        config: WorkerConfig,
    ) -> Result<JoinHandle<Outcome<WorkerError>>, EmbeddedError> {
        let worker = Worker::new(self.connector.channel(), &self.objects, device, config)?;
        let drain = self.drain.clone();
        let runtime = tokio::runtime::Handle::current();
        let run = move || {
            runtime
                .block_on(worker.run(drain.cancelled_owned()))
                .map(drop)
        };
        Ok(tokio::task::spawn_blocking(run))
    }

    /// A client of the service, over the in-memory stream.
    pub fn client(&self) -> YotoClient {
        YotoClient::new(self.connector.channel())
    }

    /// Address of the service for other processes.
    pub fn address(&self) -> Option<SocketAddr> {
        self.address
    }

    /// The object store, for workers in other processes, without credentials.
    pub fn shown_objects_url(&self) -> Url {
        yoto_server::shown(&self.objects)
    }

    /// The worker's device.
    pub fn device(&self) -> &str {
        &self.device
    }

    /// Returns only if a part ends unexpectedly, with the part and the reason.
    pub async fn failed(&mut self) -> EmbeddedError {
        tokio::select! {
            error = ended_early(&mut self.coordinator, "coordinator") => error,
            error = ended_early(&mut self.trainer, "trainer") => error,
            error = ended_early(&mut self.worker, "worker") => error,
        }
    }

    /// Ends the service: the worker saves and returns its job, open calls get a few
    /// seconds, then everything is closed.
    ///
    /// # Errors
    /// When a part failed, or was stopped by force.
    pub async fn shutdown(mut self) -> Result<(), EmbeddedError> {
        self.drain.cancel();
        let (trainer, worker) = tokio::join!(
            joined(self.trainer.take(), "trainer", WORKER_DRAIN + SLACK),
            joined(self.worker.take(), "worker", WORKER_DRAIN + SLACK),
        );
        self.stop.cancel();
        let coordinator = joined(
            self.coordinator.take(),
            "coordinator",
            self.drain_time + 3 * SERVER_GRACE + SLACK,
        )
        .await;
        trainer.and(worker).and(coordinator)
    }
}

impl Drop for Embedded {
    fn drop(&mut self) {
        self.drain.cancel();
        self.stop.cancel();
    }
}

/// The folder without what a process that was killed has left in it. Nobody else uses it: the data folder
/// is locked.
fn emptied(folder: PathBuf) -> Result<PathBuf, WorkerError> {
    match std::fs::remove_dir_all(&folder) {
        Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
            Err(WorkerError::Scratch { folder, source })
        }
        _ => Ok(folder),
    }
}

/// Serves both sides until each is stopped, then closes the data folder.
async fn coordinate(
    coordinator: Coordinator,
    incoming: InMemoryIncoming,
    listener: Option<(TcpListener, Option<Certificates>, Admission)>,
    drain: CancellationToken,
    drain_time: Duration,
    stop: CancellationToken,
) -> Outcome<ServerError> {
    let memory = coordinator.serve(incoming, stop.cancelled());
    let network = async {
        match listener {
            Some((listener, certificates, admission)) => {
                let drained = async {
                    drain.cancelled().await;
                    coordinator.leave();
                    tokio::time::sleep(drain_time).await;
                };
                match certificates {
                    None => {
                        let incoming = yoto_server::tcp(listener);
                        coordinator.serve_to(admission, incoming, drained).await
                    }
                    Some(certificates) => {
                        let incoming = yoto_server::tls(listener, certificates);
                        coordinator.serve_to(admission, incoming, drained).await
                    }
                }
            }
            None => Ok(()),
        }
    };
    let served = tokio::try_join!(memory, network);
    coordinator.close().await;
    served.map(|_| ())
}

/// The search for a device may open a driver, which blocks.
async fn pick_device() -> Result<PickedDevice, EmbeddedError> {
    let picked = tokio::task::spawn_blocking(yoto_device::pick).await;
    picked.map_err(|source| EmbeddedError::Broken {
        part: "search for a device",
        source,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn options(data: &Path) -> EmbeddedOptions {
        EmbeddedOptions {
            listen: Some(SocketAddr::from(([127, 0, 0, 1], 0))),
            ..EmbeddedOptions::new(ServerConfig::new(data))
        }
    }

    #[tokio::test]
    async fn clients_in_memory_and_over_tcp_see_the_same_service() {
        let dir = tempfile::tempdir().expect("temporary folder");
        let service = Embedded::start(options(dir.path())).await.expect("starts");
        let subject = service
            .client()
            .create_subject("ada", "signed")
            .await
            .expect("creates");
        let address = service.address().expect("listens");
        let remote = YotoClient::connect(&format!("http://{address}"))
            .await
            .expect("connects");
        assert_eq!(
            remote.find_subject("ada").await.expect("is there").name,
            subject.name
        );
        service.shutdown().await.expect("stops");

        let left = dir.path().join(SCRATCH_FOLDER).join("left by a kill");
        std::fs::create_dir_all(&left).expect("writes");
        let again = Embedded::start(options(dir.path()))
            .await
            .expect("the folder is free again");
        assert!(!left.exists(), "nobody needs it any more");
        assert_eq!(
            again.client().list_subjects().await.expect("lists").len(),
            1
        );
        again.shutdown().await.expect("stops");
    }

    #[tokio::test]
    async fn a_second_service_on_the_same_folder_is_refused() {
        let dir = tempfile::tempdir().expect("temporary folder");
        let service = Embedded::start(options(dir.path())).await.expect("starts");
        let second = Embedded::start(options(dir.path())).await;
        let error = second.expect_err("the folder is taken");
        assert!(
            matches!(
                error,
                EmbeddedError::Server(ServerError::DataDirInUse { .. })
            ),
            "{error:?}"
        );
        service.shutdown().await.expect("stops");
    }
}
