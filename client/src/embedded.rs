//! Coordinator and worker in this process, speaking the same gRPC as over a network.
//!
//! The worker and this process's own client go through an in-memory stream; other clients
//! may come over TCP. Ending it is bounded in time, whatever jobs and clients do: first
//! the network and the worker (a running job saves and goes back to the queue), then the
//! coordinator, which the worker needs until it has handed its job back.

use crate::api::YotoClient;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;
use thiserror::Error;
use tokio::net::TcpListener;
use tokio::task::{JoinError, JoinHandle};
use tokio_stream::wrappers::TcpListenerStream;
use tokio_util::sync::CancellationToken;
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_device::PickedDevice;
use yoto_ingest::IngestSettings;
use yoto_server::{
    Coordinator, InMemoryConnector, InMemoryIncoming, ServerConfig, ServerError, in_memory,
};
use yoto_worker::{Worker, WorkerConfig, WorkerError};

/// How long the worker may take to save and hand back its job.
const WORKER_DRAIN: Duration = Duration::from_secs(10);
/// How long open calls may take to end.
const SERVER_GRACE: Duration = Duration::from_secs(3);
/// What either may exceed its own bound by before it is cut off.
const SLACK: Duration = Duration::from_secs(5);

/// Where and what to run.
#[derive(Debug, Clone)]
pub struct EmbeddedOptions {
    /// Folder of database and objects.
    pub data: PathBuf,
    /// Address for clients of other processes, if any.
    pub listen: Option<SocketAddr>,
    /// Whether to run jobs here, too.
    pub worker: bool,
    /// How the worker reads uploads. By default it starts this program again, which must call
    /// [`yoto_ingest::become_ingest_child_if_asked`] first of all.
    pub ingest: IngestSettings,
    /// Weights of the networks of LPIPS, where there are any.
    pub lpips: Option<LpipsWeights>,
}

/// Why the embedded service can't start or go on.
#[derive(Debug, Error)]
pub enum EmbeddedError {
    /// The coordinator can't start or failed.
    #[error("the coordinator")]
    Server(#[from] ServerError),
    /// The worker can't start or was refused.
    #[error("the worker")]
    Worker(#[from] WorkerError),
    /// The address can't be listened at.
    #[error("listening at {address}")]
    Listen {
        /// As asked for.
        address: SocketAddr,
        /// What the system said.
        source: std::io::Error,
    },
    /// A part ended without being asked to.
    #[error("the {0} ended by itself")]
    Ended(&'static str),
    /// A part panicked.
    #[error("the {part} broke down")]
    Broken {
        /// Which.
        part: &'static str,
        /// How.
        source: JoinError,
    },
    /// A part did not end in time and was cut off.
    #[error("the {0} did not end in time and was cut off")]
    TimedOut(&'static str),
}

type Outcome<E> = Result<(), E>;

/// A running service.
#[derive(Debug)]
pub struct Embedded {
    connector: InMemoryConnector,
    address: Option<SocketAddr>,
    objects: String,
    device: String,
    /// Ends the network side and the worker.
    drain: CancellationToken,
    /// Ends the in-memory side, which the worker needs while it drains.
    stop: CancellationToken,
    coordinator: Option<JoinHandle<Outcome<ServerError>>>,
    worker: Option<JoinHandle<Outcome<WorkerError>>>,
}

impl Embedded {
    /// Opens the data folder and starts serving and working.
    ///
    /// # Errors
    /// When the folder is in use or unusable, or the address can't be listened at.
    pub async fn start(options: EmbeddedOptions) -> Result<Self, EmbeddedError> {
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
        let config = ServerConfig {
            shutdown_grace: SERVER_GRACE,
            ..ServerConfig::new(options.data)
        };
        let coordinator = Coordinator::open(config).await?;
        let objects = coordinator.objects_url().to_string();
        let (connector, incoming) = in_memory();
        let (drain, stop) = (CancellationToken::new(), CancellationToken::new());
        let mut embedded = Self {
            coordinator: Some(tokio::spawn(coordinate(
                coordinator,
                incoming,
                listener,
                drain.clone(),
                stop.clone(),
            ))),
            worker: None,
            connector,
            address,
            objects: objects.clone(),
            device: "no device: this process only coordinates".to_owned(),
            drain,
            stop,
        };
        if options.worker {
            let picked = pick_device().await?;
            embedded.device.clone_from(&picked.info.adapter);
            let config = WorkerConfig {
                display_name: "embedded".into(),
                // Asking costs nothing in one's own process.
                idle_poll_seconds: 0.25,
                drain_seconds: WORKER_DRAIN.as_secs_f64(),
                ingest: options.ingest,
                lpips: options.lpips,
                ..WorkerConfig::default()
            };
            let worker = Worker::new(embedded.connector.channel(), &objects, picked, config)?;
            let drain = embedded.drain.clone();
            // On a thread of its own: heartbeats must go out however busy the coordinator is.
            let runtime = tokio::runtime::Handle::current();
            let run = move || runtime.block_on(worker.run(drain.cancelled_owned()));
            embedded.worker = Some(tokio::task::spawn_blocking(run));
        }
        Ok(embedded)
    }

    /// A client of the service, over the in-memory stream.
    pub fn client(&self) -> YotoClient {
        YotoClient::new(self.connector.channel())
    }

    /// Where other processes reach the service.
    pub fn address(&self) -> Option<SocketAddr> {
        self.address
    }

    /// The object store, for workers in other processes.
    pub fn objects_url(&self) -> &str {
        &self.objects
    }

    /// What the worker computes on.
    pub fn device(&self) -> &str {
        &self.device
    }

    /// Returns only if a part ends that was not asked to, and says which and why.
    pub async fn failed(&mut self) -> EmbeddedError {
        tokio::select! {
            error = ended_early(&mut self.coordinator, "coordinator") => error,
            error = ended_early(&mut self.worker, "worker") => error,
        }
    }

    /// Ends the service: the worker saves and hands its job back, open calls get a few
    /// seconds, then everything is closed.
    ///
    /// # Errors
    /// When a part failed, or had to be cut off.
    pub async fn shutdown(mut self) -> Result<(), EmbeddedError> {
        self.drain.cancel();
        let worker = joined(self.worker.take(), "worker", WORKER_DRAIN + SLACK).await;
        self.stop.cancel();
        let coordinator = joined(
            self.coordinator.take(),
            "coordinator",
            3 * SERVER_GRACE + SLACK,
        )
        .await;
        worker.and(coordinator)
    }
}

impl Drop for Embedded {
    fn drop(&mut self) {
        self.drain.cancel();
        self.stop.cancel();
    }
}

/// Serves both sides until each is told to stop, then closes the data folder.
async fn coordinate(
    coordinator: Coordinator,
    incoming: InMemoryIncoming,
    listener: Option<TcpListener>,
    drain: CancellationToken,
    stop: CancellationToken,
) -> Outcome<ServerError> {
    let memory = coordinator.serve(incoming, stop.cancelled());
    let network = async {
        match listener {
            Some(listener) => {
                coordinator
                    .serve(TcpListenerStream::new(listener), drain.cancelled())
                    .await
            }
            None => Ok(()),
        }
    };
    let served = tokio::try_join!(memory, network);
    coordinator.close().await;
    served.map(|_| ())
}

/// Looking for a device may open a driver, which blocks.
async fn pick_device() -> Result<PickedDevice, EmbeddedError> {
    let picked = tokio::task::spawn_blocking(yoto_device::pick).await;
    picked.map_err(|source| EmbeddedError::Broken {
        part: "search for a device",
        source,
    })
}

/// Why a part ended that should run on; never returns while it runs, or if there is none.
async fn ended_early<E>(
    part: &mut Option<JoinHandle<Outcome<E>>>,
    name: &'static str,
) -> EmbeddedError
where
    EmbeddedError: From<E>,
{
    let Some(handle) = part else {
        return std::future::pending().await;
    };
    let ended = handle.await;
    // A finished task must not be awaited again by `shutdown`.
    *part = None;
    outcome(ended, name)
        .err()
        .unwrap_or(EmbeddedError::Ended(name))
}

/// How a part ended, which it must within `limit`.
async fn joined<E>(
    part: Option<JoinHandle<Outcome<E>>>,
    name: &'static str,
    limit: Duration,
) -> Result<(), EmbeddedError>
where
    EmbeddedError: From<E>,
{
    let Some(mut handle) = part else {
        return Ok(());
    };
    match tokio::time::timeout(limit, &mut handle).await {
        Ok(ended) => outcome(ended, name),
        Err(_) => {
            handle.abort();
            Err(EmbeddedError::TimedOut(name))
        }
    }
}

fn outcome<E>(ended: Result<Outcome<E>, JoinError>, part: &'static str) -> Result<(), EmbeddedError>
where
    EmbeddedError: From<E>,
{
    ended
        .map_err(|source| EmbeddedError::Broken { part, source })?
        .map_err(EmbeddedError::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(data: PathBuf) -> EmbeddedOptions {
        EmbeddedOptions {
            data,
            listen: Some(SocketAddr::from(([127, 0, 0, 1], 0))),
            worker: true,
            ingest: IngestSettings::default(),
            lpips: None,
        }
    }

    #[tokio::test]
    async fn clients_in_memory_and_over_tcp_see_the_same_service() {
        let dir = tempfile::tempdir().expect("temporary folder");
        let service = Embedded::start(options(dir.path().to_owned()))
            .await
            .expect("starts");
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

        let again = Embedded::start(options(dir.path().to_owned()))
            .await
            .expect("the folder is free again");
        assert_eq!(
            again.client().list_subjects().await.expect("lists").len(),
            1
        );
        again.shutdown().await.expect("stops");
    }

    #[tokio::test]
    async fn a_second_service_on_the_same_folder_is_refused() {
        let dir = tempfile::tempdir().expect("temporary folder");
        let service = Embedded::start(options(dir.path().to_owned()))
            .await
            .expect("starts");
        let second = Embedded::start(options(dir.path().to_owned())).await;
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
