//! A coordinator: its parts are opened in order, and closed in order.

use crate::access::{Admission, Callers};
use crate::config::ServerConfig;
use crate::context::{Alone, Context};
use crate::data_dir::{self, DataDirLock, OwnDataDir, create_dir, objects_url, open_store};
use crate::error::ServerError;
use crate::health::HealthCheck;
use crate::jobs::reaper;
use crate::notify::{Notifier, hints};
use crate::objects::place::ObjectsPlace;
use crate::objects::{Storage, collect};
use crate::uploads::UploadLocks;
use crate::{audit, erasure, otlp, serve, sign_in, webhooks};
use futures::Stream;
use std::future::Future;
use std::sync::Arc;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;
use tonic::transport::server::Connected;
use url::Url;
use yoto_store::{Tenant, binding};

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
        let folder = create_dir(&config.data_dir)?;
        let lock = DataDirLock::take(&folder)?;
        let url = objects_url(&config, &folder)?;
        let (place, objects) = ObjectsPlace::open(&url, &config).await?;
        let store = Arc::new(open_store(&config, &folder).await?);
        let id = binding::check(&objects, &url, &store).await?;
        let storage = Arc::new(Storage { url, id, place });
        let instance = data_dir::instance(&folder)?;
        let stop = CancellationToken::new();
        let notifier = Notifier::new(&store, &config, &instance, ended.clone(), &stop);
        let context = Arc::new(Context {
            notifier: Arc::new(notifier),
            callers: Arc::new(Callers::new(&store, config.oidc.is_some())),
            issuer: sign_in::IssuerCache::default(),
            audit: Arc::new(audit::Audit::new(config.traffic.refused_calls)),
            health: Arc::new(HealthCheck::new(&store, &objects, &storage)),
            upload_locks: UploadLocks::default(),
            alone: Alone::default(),
            started: config.clock.time(),
            stop,
            data_dir: OwnDataDir { lock, instance },
            config,
            store,
            objects,
            storage,
        });
        reaper::take_back_embedded(&context).await?;
        let mut tasks = vec![
            tokio::spawn(reaper::run(Arc::clone(&context))),
            tokio::spawn(erasure::run(Arc::clone(&context))),
            tokio::spawn(collect::run(Arc::clone(&context))),
            tokio::spawn(
                Arc::clone(&context.health)
                    .run(context.config.health_interval, context.stop.clone()),
            ),
            tokio::spawn(audit::run(
                Arc::clone(&context.audit),
                Arc::clone(&context.store),
                context.stop.clone(),
            )),
            tokio::spawn(webhooks::run(Arc::clone(&context))),
        ];
        if context.config.hints {
            tasks.push(tokio::spawn(hints::send(Arc::clone(&context.notifier))));
            tasks.push(tokio::spawn(hints::listen(Arc::clone(&context.notifier))));
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
        self.context.health.leave();
    }

    /// Where the objects are, for workers to open.
    pub fn objects_url(&self) -> &Url {
        &self.context.storage.url
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
        self.context.data_dir.lock.release();
    }
}

impl Drop for Coordinator {
    fn drop(&mut self) {
        self.context.stop.cancel();
    }
}
