//! Settings for operators, with the defaults of an embedded coordinator.

mod oidc;
mod otlp;
mod traffic;

pub use oidc::{Grant, GrantedScope, OidcConfig};
pub use otlp::{OtlpConfig, OtlpEndpoint, OtlpError, OtlpHeaders};
pub use traffic::TrafficLimits;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use thiserror::Error;
use url::Url;
use yoto_objects::Environment;
use yoto_process::clock::{Clock, SystemClock};
use yoto_process::faults::Faults;
use yoto_proto::limits;
use yoto_store::PostgresUrl;
use yoto_store::rules::retention::Retention;

/// Settings under which nothing can run, in words that name the field.
#[derive(Debug, Error)]
#[error("{0}")]
pub struct ConfigError(pub(crate) String);

/// Settings of a [`crate::Coordinator`].
#[derive(Debug, Clone)]
pub struct ServerConfig {
    /// Folder of the lock, and by default of the database and the objects.
    pub data_dir: PathBuf,
    /// The database; none means a file of SQLite in the data folder.
    pub database: Option<PostgresUrl>,
    /// Where objects are stored, `file:///…` or `s3://…`; none means `objects/` in the data folder.
    pub objects: Option<Url>,
    /// Settings and credentials of a remote store.
    pub environment: Environment,
    /// Longest silence of a worker before its job goes to another.
    pub lease_seconds: f64,
    /// Interval of the search for expired leases.
    pub reap_interval: Duration,
    /// Number of lost workers after which a job FAILS, counted from its last published checkpoint.
    pub max_lost_workers: u32,
    /// The clock of jobs and leases. The system's clock is replaced by the one of PostgreSQL.
    pub clock: Arc<dyn Clock>,
    /// Interval between reads of a watched job without announced changes.
    pub watch_poll: Duration,
    /// Whether coordinators of one database tell each other what has changed.
    pub hints: bool,
    /// The interval of [`Self::watch_poll`] while they do.
    pub hinted_poll: Duration,
    /// Whether nobody is in a job without a valid consent to its purpose. Otherwise only a consent that was revoked or has run
    /// out keeps a person out of jobs.
    pub require_consent: bool,
    /// How long clients can read an object from the store by a signed URL, or write a part of an upload, for which less may
    /// be enough; none: they get no URLs, and the bytes pass through the coordinator.
    pub signed_urls: Option<Duration>,
    /// Interval of the health checks, each of which writes to the database.
    pub health_interval: Duration,
    /// Longest time for open connections to end after the start of a shutdown.
    pub shutdown_grace: Duration,
    /// Limits of one uploaded capture.
    pub upload: UploadLimits,
    /// What is stored, and for how long.
    pub storage: StorageLimits,
    /// Limits of connections, calls and requests.
    pub traffic: TrafficLimits,
    /// Where figures and traces are sent, if anywhere.
    pub otlp: Option<OtlpConfig>,
    /// Sites whose pages may make calls with a key, `https://app.example.org`.
    pub allow_origins: Vec<String>,
    /// An issuer by which people sign in. With one, callers are asked for a key also before there is any.
    pub oidc: Option<OidcConfig>,
    /// Whether webhooks may lead to this machine and to private networks, also without TLS.
    pub private_webhooks: bool,
    /// Injected faults, for tests of the service.
    pub faults: Option<Arc<dyn Faults>>,
}

const DAY: Duration = Duration::from_secs(24 * 3600);

/// What is stored, and for how long.
#[derive(Debug, Clone)]
pub struct StorageLimits {
    /// Newest checkpoints that a model keeps unless it says otherwise, at least 1.
    pub keep_newest: u32,
    /// Every n-th published checkpoint is kept unless the model says otherwise; 0: none.
    pub keep_every: u32,
    /// Time of grace: from the moment when objects are found to be garbage until they are removed.
    pub grace: Duration,
    /// Interval of the search for such objects.
    pub collect_interval: Duration,
    /// Free bytes of the disk, or of the limit, below which uploads and trainings are refused.
    pub min_free_bytes: u64,
    /// Bytes that all objects may have together, as counted at each collection; none: as many as the disk or the store
    /// takes.
    pub limit_bytes: Option<u64>,
    /// Time from the last write of an upload until its files are garbage once they were read.
    pub keep_uploads: Duration,
    /// Age at which answers to request ids are forgotten.
    pub keep_request_ids: Duration,
    /// Age at which the history of ended attempts is forgotten.
    pub keep_attempts: Duration,
    /// Age at which workers without jobs are forgotten.
    pub keep_workers: Duration,
    /// Age at which entries of the audit log are removed; none: never.
    pub keep_audit: Option<Duration>,
}

impl Default for StorageLimits {
    fn default() -> Self {
        Self {
            keep_newest: 3,
            keep_every: 10,
            grace: DAY,
            collect_interval: Duration::from_secs(3600),
            min_free_bytes: 2 << 30,
            limit_bytes: None,
            keep_uploads: 7 * DAY,
            keep_request_ids: 7 * DAY,
            keep_attempts: 90 * DAY,
            keep_workers: 7 * DAY,
            keep_audit: None,
        }
    }
}

impl StorageLimits {
    /// Which checkpoints a model keeps unless it says otherwise.
    pub(crate) fn retention(&self) -> Retention {
        Retention {
            newest: self.keep_newest,
            every: self.keep_every,
        }
    }
}

/// Limits of one uploaded capture, enforced before anything is decoded.
#[derive(Debug, Clone)]
pub struct UploadLimits {
    /// Bytes of one file.
    pub file_bytes: u64,
    /// Bytes of all files.
    pub capture_bytes: u64,
    /// Number of files.
    pub files: usize,
    /// Bytes that are committed at once.
    pub part_bytes: u64,
    /// Longest silence of the client within a call.
    pub idle: Duration,
    /// Longest time without a write, after which an upload ends by itself.
    pub expiry: Duration,
}

impl ServerConfig {
    /// The defaults, with everything in `data_dir`.
    pub fn new(data_dir: impl Into<PathBuf>) -> Self {
        Self {
            data_dir: data_dir.into(),
            database: None,
            objects: None,
            environment: Environment::of_process(),
            lease_seconds: 20.0,
            reap_interval: Duration::from_millis(500),
            max_lost_workers: 5,
            clock: Arc::new(SystemClock),
            watch_poll: Duration::from_millis(250),
            hints: true,
            hinted_poll: Duration::from_secs(2),
            require_consent: false,
            signed_urls: None,
            health_interval: Duration::from_secs(5),
            shutdown_grace: Duration::from_secs(5),
            upload: UploadLimits {
                file_bytes: limits::FILE_BYTES,
                capture_bytes: limits::CAPTURE_BYTES,
                files: limits::CAPTURE_FILES,
                part_bytes: limits::PART_BYTES,
                idle: Duration::from_secs(60),
                expiry: Duration::from_secs(24 * 3600),
            },
            storage: StorageLimits::default(),
            traffic: TrafficLimits::default(),
            otlp: None,
            allow_origins: Vec::new(),
            oidc: None,
            private_webhooks: false,
            faults: None,
        }
    }

    /// Rejects settings under which nothing can run.
    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        if !(self.lease_seconds.is_finite() && self.lease_seconds > 0.0) {
            let message = format!(
                "lease_seconds is {}; it must be above 0",
                self.lease_seconds
            );
            return Err(ConfigError(message));
        }
        let intervals = [
            self.reap_interval,
            self.watch_poll,
            self.hinted_poll,
            self.health_interval,
        ];
        if intervals.iter().any(Duration::is_zero) {
            let message =
                "reap_interval, watch_poll, hinted_poll and health_interval must be above 0";
            return Err(ConfigError(message.to_owned()));
        }
        if self.otlp.as_ref().is_some_and(|it| it.interval.is_zero()) {
            let message = "otlp.interval must be above 0".to_owned();
            return Err(ConfigError(message));
        }
        if self.storage.collect_interval.is_zero() || self.storage.keep_newest == 0 {
            let message = "storage.collect_interval and storage.keep_newest must be above 0";
            return Err(ConfigError(message.to_owned()));
        }
        if self.upload.part_bytes == 0 || self.upload.part_bytes > limits::FILE_BYTES {
            let message = "upload.part_bytes must be above 0, and no more than a file".to_owned();
            return Err(ConfigError(message));
        }
        if let Some(oidc) = &self.oidc {
            oidc.check()?;
        }
        if self.max_lost_workers == 0 {
            return Err(ConfigError(
                "max_lost_workers must be at least 1".to_owned(),
            ));
        }
        Ok(())
    }
}
