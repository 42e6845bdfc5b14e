//! The coordinator: API, jobs, catalogue, objects. It has no tensors and decodes no media.
//!
//! A request passes through the layers: `api` (gRPC) → `jobs`, `uploads` and `objects` → `store`
//! (database, by the `rules` of the queue). [`Coordinator`] opens them on a data folder and serves them on any
//! stream of connections, over a network or [in memory](in_memory()).

mod access;
mod adopt;
mod api;
mod audit;
pub mod backup;
mod changes;
pub mod config;
mod context;
mod erasure;
mod error;
mod fault_layer;
pub mod fsck;
mod health;
mod hints;
mod in_memory;
mod instance;
mod job_feed;
mod jobs;
mod key_store;
mod listen;
mod lock;
mod objects;
mod on_host;
mod otlp;
mod outgoing;
mod pages;
mod serve;
mod sign_in;
mod tls;
mod traffic;
mod uploads;
mod webhooks;

pub use access::Admission;
pub use adopt::adopt;
pub use audit::{AuditError, AuditLog};
pub use config::{ServerConfig, StorageLimits, UploadLimits};
pub use error::ServerError;
pub use in_memory::{InMemoryConnector, InMemoryIncoming, in_memory};
pub use key_store::KeyStore;
pub use listen::tcp;
pub use otlp::{OtlpConfig, OtlpEndpoint, OtlpError, OtlpHeaders};
pub use sign_in::{Grant, OidcConfig};
pub use tls::{Certificates, Encrypted, TlsError, TlsFiles, tls};
pub use traffic::TrafficLimits;
pub use yoto_objects::{Environment, ObjectsError, shown};
pub use yoto_process::{clock, faults};
pub use yoto_store::audit_chain::{Broken, Head as AuditHead};
pub use yoto_store::binding::BindingError;
pub use yoto_store::{AuditEntry, PostgresUrl, StoreError, Tenant, UrlError};

use access::keys::KeyRing;
use access::rates::Rates;
use audit::Audit;
use changes::JobChanges;
use context::Context;
use futures::Stream;
use hints::Hints;
use job_feed::JobFeed;
use jobs::reaper;
use lock::DataDirLock;
use objects::collect;
use objects::place::Place;
use std::future::Future;
use std::path::Path;
use std::sync::Arc;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;
use tonic::transport::server::Connected;
use uploads::UploadLocks;
use url::Url;
use yoto_store::{Store, binding};

/// The database's file in the data folder, unless the configuration names a database of PostgreSQL.
const DATABASE_FILE: &str = "yoto.db";
/// The objects' folder in the data folder.
const OBJECTS_FOLDER: &str = "objects";

/// An open coordinator: it owns its data folder, takes jobs back from lost workers and collects garbage.
/// [`Coordinator::close`] ends it in order; dropping it stops it as well.
pub struct Coordinator {
    context: Arc<Context>,
    tasks: Vec<JoinHandle<()>>,
}

impl Coordinator {
    /// Opens the data folder and creates missing parts. Uploads that an earlier process left open continue
    /// where they were.
    ///
    /// # Errors
    /// [`ServerError::DataDirInUse`] when another coordinator has the folder; others when
    /// the configuration is invalid, or the folder, database or object store can't be
    /// opened.
    pub async fn open(config: ServerConfig) -> Result<Self, ServerError> {
        config.check()?;
        let otlp = config.otlp.clone();
        let wire = otlp.as_ref().map(|it| otlp::Wire::new(&it.endpoint));
        let wire = wire.transpose()?;
        let ended = otlp.as_ref().map(|_| Arc::default());
        let data_dir = create_dir(&config.data_dir)?;
        let lock = DataDirLock::take(&data_dir)?;
        let objects_url = objects_url(&config, &data_dir)?;
        let (place, objects) = Place::open(&objects_url, &config).await?;
        let store = open_store(&config, &data_dir).await?;
        let store_id = binding::check(&objects, &objects_url, &store).await?;
        let instance = instance::of(&data_dir)?;
        let hints = Hints::new(config.hints && store.is_shared());
        let started = config.clock.time();
        let context = Arc::new(Context {
            config,
            store,
            objects,
            objects_url,
            store_id,
            place,
            changes: JobChanges::default(),
            feed: JobFeed::default(),
            ended: ended.clone(),
            hints,
            instance,
            started,
            health: tokio::sync::watch::Sender::default(),
            exposed: tokio::sync::Mutex::default(),
            keys: KeyRing::default(),
            rates: Rates::default(),
            sign_in: sign_in::Found::default(),
            audit: Audit::default(),
            stop: CancellationToken::new(),
            lock,
            upload_locks: UploadLocks::default(),
            collecting: tokio::sync::Mutex::new(()),
            reaping: tokio::sync::Mutex::new(()),
            erasing: tokio::sync::Mutex::new(()),
        });
        reaper::take_back_embedded(&context).await?;
        let mut tasks = vec![
            tokio::spawn(reaper::run(Arc::clone(&context))),
            tokio::spawn(erasure::run(Arc::clone(&context))),
            tokio::spawn(collect::run(Arc::clone(&context))),
            tokio::spawn(health::run(Arc::clone(&context))),
            tokio::spawn(audit::run(Arc::clone(&context))),
            tokio::spawn(webhooks::run(Arc::clone(&context))),
        ];
        if context.config.hints {
            tasks.push(tokio::spawn(hints::send(Arc::clone(&context))));
            tasks.push(tokio::spawn(hints::listen(Arc::clone(&context))));
        }
        if let (Some(otlp), Some(wire), Some(ended)) = (otlp, wire, ended) {
            let context = Arc::clone(&context);
            tasks.push(tokio::spawn(otlp::run(context, otlp, wire, ended)));
        }
        Ok(Self { context, tasks })
    }

    /// Serves all services, with health and reflection, on `incoming` until `shutdown` is
    /// ready or the coordinator is closed; then open calls have
    /// [`ServerConfig::shutdown_grace`] to end. Several may run at once, such as on a TCP
    /// listener and in memory. The future borrows nothing, so it can be spawned. All calls are
    /// those of the default tenant, and may do everything: the other end is in this process.
    ///
    /// # Errors
    /// When the transport fails.
    pub fn serve<I, IO, IE, F>(
        &self,
        incoming: I,
        shutdown: F,
    ) -> impl Future<Output = Result<(), ServerError>> + use<I, IO, IE, F>
    where
        I: Stream<Item = Result<IO, IE>>,
        IO: AsyncRead + AsyncWrite + Connected + Unpin + Send + 'static,
        IE: Into<Box<dyn std::error::Error + Send + Sync>>,
        F: Future<Output = ()>,
    {
        self.serve_to(Admission::Process(Tenant::default()), incoming, shutdown)
    }

    /// [`Coordinator::serve`] for those whom `admission` admits.
    ///
    /// # Errors
    /// When the transport fails.
    pub fn serve_to<I, IO, IE, F>(
        &self,
        admission: Admission,
        incoming: I,
        shutdown: F,
    ) -> impl Future<Output = Result<(), ServerError>> + use<I, IO, IE, F>
    where
        I: Stream<Item = Result<IO, IE>>,
        IO: AsyncRead + AsyncWrite + Connected + Unpin + Send + 'static,
        IE: Into<Box<dyn std::error::Error + Send + Sync>>,
        F: Future<Output = ()>,
    {
        serve::serve(Arc::clone(&self.context), admission, incoming, shutdown)
    }

    /// Checks all leases now, as the coordinator does by itself at every [`ServerConfig::reap_interval`]. The jobs whose
    /// leases had expired are taken back when it returns.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn look_after_leases(&self) -> Result<(), ServerError> {
        Ok(reaper::tick(&self.context).await?)
    }

    /// Says from now on that nobody should come any more: health is NOT_SERVING, and `/readyz` answers 503. Calls are still
    /// answered, until a balancer has noticed and the coordinator is closed.
    pub fn leave(&self) {
        health::change(&self.context, |health| health.leaving = true);
    }

    /// Where the objects are, for workers to open.
    pub fn objects_url(&self) -> &Url {
        &self.context.objects_url
    }

    /// Stops serving, reaping and collecting, closes the database, and unlocks the data folder.
    pub async fn close(mut self) {
        self.context.stop.cancel();
        let grace = self.context.config.shutdown_grace;
        for task in &mut self.tasks {
            if tokio::time::timeout(grace, &mut *task).await.is_err() {
                tracing::warn!("a background task did not stop in time");
                task.abort();
            }
        }
        if tokio::time::timeout(grace, self.context.store.close())
            .await
            .is_err()
        {
            tracing::warn!("the database did not close in time");
        }
        self.context.lock.release();
    }
}

impl Drop for Coordinator {
    fn drop(&mut self) {
        self.context.stop.cancel();
    }
}

/// Where the objects are.
fn objects_url(config: &ServerConfig, data_dir: &Path) -> Result<Url, ServerError> {
    match &config.objects {
        Some(url) => Ok(url.clone()),
        None => folder_url(&data_dir.join(OBJECTS_FOLDER)),
    }
}

/// Opens the database, and brings its schema up to date.
async fn open_store(config: &ServerConfig, data_dir: &Path) -> Result<Store, StoreError> {
    let clock = config.clock.clone();
    let store = match &config.database {
        Some(url) => Store::open_postgres(url, clock).await?,
        None => Store::open_sqlite(&data_dir.join(DATABASE_FILE), clock).await?,
    };
    Ok(store.requiring_consent(config.require_consent))
}

fn create_dir(path: &Path) -> Result<std::path::PathBuf, ServerError> {
    let failed = |cause| ServerError::DataDir {
        path: path.to_owned(),
        cause,
    };
    yoto_process::private::create_dir_all(path).map_err(failed)?;
    if yoto_process::private::is_open_to_others(path).map_err(failed)? {
        tracing::warn!(
            folder = %path.display(),
            "other users of this machine can look into the data folder; `chmod 700` closes it"
        );
    }
    path.canonicalize().map_err(failed)
}

fn folder_url(path: &Path) -> Result<Url, ServerError> {
    Url::from_directory_path(path)
        .map_err(|()| ServerError::Config(format!("{} is not absolute", path.display())))
}
