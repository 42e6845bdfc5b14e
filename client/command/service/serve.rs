//! `yoto serve`: coordinator and worker in one process.

use super::exposure::Exposure;
use super::open_files;
use super::signals::stop_signals;
use super::signed_urls::SignedUrls;
use super::state::{ObjectsArgs, StateArgs};
use super::telemetry::TelemetryArgs;
use crate::embedded::{Embedded, EmbeddedOptions};
use crate::show;
use anyhow::Context;
use clap::Args;
use clap::builder::BoolishValueParser;
use std::net::{IpAddr, SocketAddr, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::pin::pin;
use std::time::Duration;
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_server::{OidcConfig, ServerConfig, StorageLimits, TrafficLimits};

const AFTER_HELP: &str = "\
All state of the service is in the data folder: an SQLite database and the objects (uploads,
checkpoints, renders). Only one process can serve a folder at a time. --database keeps the rows in
PostgreSQL, and --objects keeps the objects in S3-compatible storage, whose settings are environment variables:
AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY, AWS_REGION, and AWS_ENDPOINT_URL unless it is AWS.

SIGTERM or ctrl-c: no new jobs start, a training job saves a checkpoint and returns to the
queue, and the process ends, even with connected clients.

Beyond this machine the service needs TLS, and asks every caller for a key (`yoto key`); on loopback it asks
from the first key on.

On the same port, /healthz, /readyz and /metrics serve balancers and Prometheus; --otlp sends the same figures
to an OpenTelemetry collector. Each option can also be an environment variable, YOTO_LISTEN for --listen
(OTEL_EXPORTER_OTLP_ENDPOINT for --otlp), or a key of --config.

http://ADDRESS/ is the dashboard: people, models with their curves, jobs, workers, and the service.

Examples:
  yoto serve
  yoto serve --open
  yoto serve --data /srv/yoto --listen 127.0.0.1:6000
  yoto serve --database 'postgres://yoto@db.example/yoto?sslmode=verify-full'
  yoto serve --print-config > yoto.toml
  yoto serve --config yoto.toml
  curl http://127.0.0.1:50051/readyz
  yoto serve --objects s3://bucket/prefix
  yoto serve --listen 0.0.0.0:50051 --tls-cert yoto.crt --tls-key yoto.key
  grpcurl -plaintext 127.0.0.1:50051 list";

/// Run the service on this machine: API, jobs, storage and a worker.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Serve {
    #[command(flatten)]
    state: StateArgs,
    #[command(flatten)]
    objects: ObjectsArgs,
    /// Whether clients read files directly from the --objects store, and write parts of uploads to it, by URLs that
    /// the service signs. A URL is valid for 15 minutes to read a file, and for 2 to write a part. With `auto`,
    /// clients use the store if it signs URLs (S3) and they can reach it; otherwise, and always with `never`, the
    /// bytes pass through the service.
    #[arg(
        long,
        env = "YOTO_SIGNED_URLS",
        value_name = "WHEN",
        default_value = "never"
    )]
    signed_urls: SignedUrls,
    /// Address to listen at: host and port.
    #[arg(
        long,
        env = "YOTO_LISTEN",
        value_name = "ADDRESS",
        default_value = "127.0.0.1:50051",
        value_parser = address
    )]
    listen: SocketAddr,
    /// Refuse jobs of people who have not consented to their purpose (`yoto subject consent`). Without this option, jobs are
    /// refused only where a consent was revoked or has expired. All coordinators of a database need the same setting.
    #[arg(long, env = "YOTO_REQUIRE_CONSENT", value_parser = BoolishValueParser::new())]
    require_consent: bool,
    /// Sites whose pages may make calls with a key, by gRPC-Web or HTTP (CORS), separated by commas.
    #[arg(
        long = "allow-origin",
        env = "YOTO_ALLOW_ORIGIN",
        value_name = "ORIGIN",
        value_delimiter = ','
    )]
    allow_origins: Vec<String>,
    /// Let people sign in to the dashboard at an issuer of OpenID Connect: a file in TOML that names the issuer, and
    /// who may do what (docs/operate/security.md). Callers then need a key even before the first one is made.
    #[arg(long, env = "YOTO_OIDC", value_name = "FILE")]
    oidc: Option<PathBuf>,
    /// Allow webhooks (`yoto webhook`) that lead to this machine or to a private network, also without TLS. Anyone
    /// with a key can then make the service send requests there.
    #[arg(long, env = "YOTO_PRIVATE_WEBHOOKS", value_parser = BoolishValueParser::new())]
    private_webhooks: bool,
    /// Run no worker: jobs wait for a worker in another process.
    #[arg(long, env = "YOTO_NO_WORKER", value_parser = BoolishValueParser::new())]
    no_worker: bool,
    /// Folder for the files of running jobs: uploads to read, checkpoints to load and save. By default
    /// scratch/ in the data folder.
    #[arg(long, env = "YOTO_SCRATCH", value_name = "DIR")]
    scratch: Option<PathBuf>,
    #[command(flatten)]
    exposure: Exposure,
    /// Open the dashboard in the browser.
    #[arg(long)]
    open: bool,
    /// Time from SIGTERM until calls are refused, seconds. Meanwhile `/readyz` and the health check of gRPC report
    /// that the service is not ready, so that a balancer sends calls elsewhere. Workers in this process stop at once.
    #[arg(
        long,
        env = "YOTO_DRAIN_SECONDS",
        value_name = "SECONDS",
        default_value_t = 0.0
    )]
    drain_seconds: f64,
    /// Settings of this command in TOML: each key is the name of an option, without its leading dashes.
    #[arg(long, env = "YOTO_CONFIG", value_name = "FILE")]
    config: Option<PathBuf>,
    /// Print all settings as a file for --config, with their values and where each comes from, and exit.
    #[arg(long)]
    print_config: bool,
    #[command(flatten)]
    telemetry: TelemetryArgs,
    #[command(flatten)]
    storage: Storage,
    #[command(flatten)]
    pub(crate) logs: crate::service::logs::LogArgs,
    #[command(flatten)]
    ingest: crate::args::IngestArgs,
    #[command(flatten)]
    lpips: yoto_terminal::args::LpipsArgs,
}

/// What the service stores, and for how long.
#[derive(Debug, Args)]
struct Storage {
    /// Newest checkpoints that a model keeps, unless `yoto model keep` says otherwise.
    #[arg(long, env = "YOTO_KEEP_NEWEST", value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
    keep_newest: u32,
    /// A model also keeps every N-th checkpoint; 0 keeps none for this reason.
    #[arg(long, env = "YOTO_KEEP_EVERY", value_name = "N", default_value_t = 10)]
    keep_every: u32,
    /// Hours until objects that nothing refers to are removed.
    #[arg(
        long,
        env = "YOTO_GRACE_HOURS",
        value_name = "HOURS",
        default_value_t = 24.0
    )]
    grace_hours: f64,
    /// Free space, GiB, of the disk or of --max-objects-gib, below which uploads and trainings are refused.
    #[arg(
        long,
        env = "YOTO_MIN_FREE_GIB",
        value_name = "GIB",
        default_value_t = 2.0
    )]
    min_free_gib: f64,
    /// Space that all objects together may take, GiB, counted once an hour. By default only the disk or the store
    /// limits it.
    #[arg(long, env = "YOTO_MAX_OBJECTS_GIB", value_name = "GIB")]
    max_objects_gib: Option<f64>,
    /// Days until entries of the audit log are removed. By default they stay.
    #[arg(long, env = "YOTO_AUDIT_DAYS", value_name = "DAYS")]
    audit_days: Option<f64>,
}

/// The time that `option` names as `value` times `unit` seconds.
fn time(option: &str, value: f64, unit: f64) -> anyhow::Result<Duration> {
    let time = Duration::try_from_secs_f64(value * unit);
    time.with_context(|| format!("{option} {value}"))
}

impl Storage {
    fn limits(&self) -> anyhow::Result<StorageLimits> {
        let grace = time("--grace-hours", self.grace_hours, 3600.0)?;
        let audit = self.audit_days.map(|it| time("--audit-days", it, 86_400.0));
        let free = self.min_free_gib;
        anyhow::ensure!(free >= 0.0, "--min-free-gib {free} is below 0");
        let most = self.max_objects_gib;
        anyhow::ensure!(
            most.is_none_or(|most| most > free),
            "--max-objects-gib {} is not above --min-free-gib {free}: nothing could be stored",
            most.unwrap_or_default()
        );
        Ok(StorageLimits {
            keep_newest: self.keep_newest,
            keep_every: self.keep_every,
            grace,
            min_free_bytes: bytes(free),
            limit_bytes: most.map(bytes),
            keep_audit: audit.transpose()?,
            ..StorageLimits::default()
        })
    }
}

/// The settings of an issuer.
fn oidc(path: &Path) -> anyhow::Result<OidcConfig> {
    let text =
        std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
    let config: OidcConfig =
        toml::from_str(&text).with_context(|| format!("--oidc {}", path.display()))?;
    Ok(config.in_folder(path.parent().unwrap_or(Path::new(""))))
}

fn bytes(gib: f64) -> u64 {
    (gib * (1_u64 << 30) as f64) as u64
}

impl Serve {
    /// Where its state is, for people.
    fn place(&self) -> String {
        let data = self.state.data.display();
        match &self.state.database {
            Some(url) => format!("{data}, with {url}"),
            None => data.to_string(),
        }
    }

    /// The limits of a process that may open as many `files`, if that is known.
    fn traffic(&self, files: Option<u64>) -> TrafficLimits {
        let limits = TrafficLimits {
            by_address: !self.exposure.behind_proxy(),
            ..TrafficLimits::default()
        };
        match files {
            Some(files) => limits.for_files(files),
            None => limits,
        }
    }

    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let admission = self.exposure.admission(self.listen)?;
        let tls = self.exposure.tls();
        let scheme = if tls.is_some() { "https" } else { "http" };
        keep_private();
        let traffic = self.traffic(open_files::raise());
        let drain = time("--drain-seconds", self.drain_seconds, 1.0)?;
        let place = self.place();
        if let Some(path) = &self.config {
            tell!("settings of {}", path.display());
        }
        let server = ServerConfig {
            database: self.state.database,
            objects: self.objects.objects,
            storage: self.storage.limits()?,
            require_consent: self.require_consent,
            allow_origins: self.allow_origins,
            private_webhooks: self.private_webhooks,
            oidc: self.oidc.as_deref().map(oidc).transpose()?,
            signed_urls: self.signed_urls.life(),
            otlp: self.telemetry.config()?,
            traffic,
            ..ServerConfig::new(self.state.data)
        };
        let options = EmbeddedOptions {
            listen: Some(self.listen),
            admission,
            tls,
            worker: !self.no_worker,
            ingest: self.ingest.settings()?,
            lpips: self.lpips.weights(LpipsWeights::both)?,
            scratch: self.scratch,
            drain,
            ..EmbeddedOptions::new(server)
        };
        // A signal that comes while the service starts counts too.
        let mut stop = pin!(stop_signals().context("listening for signals")?);
        let mut service = tokio::select! {
            started = Embedded::start(options) => {
                started.with_context(|| format!("starting the service in {place}"))?
            }
            asked = &mut stop => {
                tell!("stopped before the service had started");
                return asked.context("listening for signals");
            }
        };
        if let Some(address) = service.address() {
            tell!("yoto serves {scheme}://{address} from {place}");
            tell!("objects at {}", service.shown_objects_url());
            let dashboard = dashboard(scheme, address);
            tell!("dashboard at {dashboard}");
            if self.open {
                tokio::task::spawn_blocking(move || show::in_browser(dashboard));
            }
        }
        if !self.no_worker {
            tell!("computing on {}", service.device());
            if let Some(hint) = yoto_device::hint_on_cpu() {
                tell!("{hint}");
            }
        }
        let failure = tokio::select! {
            asked = &mut stop => asked.context("listening for signals").err(),
            failed = service.failed() => Some(failed.into()),
        };
        tell!("stopping");
        service.shutdown().await.context("stopping the service")?;
        failure.map_or(Ok(()), Err)
    }
}

/// The address of the dashboard for a browser of this machine, where the service listens at `address`. A browser can't open the
/// unspecified address (0.0.0.0), so it gets the loopback address in its place.
fn dashboard(scheme: &str, address: SocketAddr) -> String {
    let port = address.port();
    match address.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => format!("{scheme}://127.0.0.1:{port}/"),
        IpAddr::V6(ip) if ip.is_unspecified() => format!("{scheme}://[::1]:{port}/"),
        _ => format!("{scheme}://{address}/"),
    }
}

/// Parses an address, or looks a name up.
fn address(text: &str) -> Result<SocketAddr, String> {
    let addresses = text.to_socket_addrs();
    let mut addresses = addresses.map_err(|error| format!("{error}; an address is HOST:PORT"))?;
    addresses
        .next()
        .ok_or_else(|| "the name has no address".to_owned())
}

/// Makes all files that this process and its children create from now on private to their user.
fn keep_private() {
    #[cfg(unix)]
    nix::sys::stat::umask(nix::sys::stat::Mode::from_bits_truncate(0o077));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_may_be_a_name() {
        assert!(
            address("localhost:6000")
                .expect("a name")
                .ip()
                .is_loopback()
        );
        for bad in ["localhost", "6000", "no such host:1"] {
            assert!(address(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn a_browser_opens_an_address_of_this_machine() {
        let at = |address: &str| dashboard("http", address.parse().expect("an address"));
        assert_eq!(at("127.0.0.1:50051"), "http://127.0.0.1:50051/");
        assert_eq!(at("[::1]:1"), "http://[::1]:1/");
        assert_eq!(at("0.0.0.0:80"), "http://127.0.0.1:80/");
        assert_eq!(at("[::]:80"), "http://[::1]:80/");
    }

    #[test]
    fn limits_are_those_of_the_service_unless_told() {
        let storage = |grace_hours, min_free_gib| Storage {
            keep_newest: 3,
            keep_every: 10,
            grace_hours,
            min_free_gib,
            max_objects_gib: None,
            audit_days: None,
        };
        let limits = storage(24.0, 2.0).limits().expect("good");
        let default = StorageLimits::default();
        assert_eq!(
            (limits.keep_newest, limits.keep_every),
            (default.keep_newest, default.keep_every)
        );
        assert_eq!(
            (limits.grace, limits.min_free_bytes),
            (default.grace, default.min_free_bytes)
        );
        for (hours, gib) in [
            (-1.0, 2.0),
            (f64::NAN, 2.0),
            (1e300, 2.0),
            (1.0, f64::NAN),
            (1.0, -1.0),
        ] {
            assert!(storage(hours, gib).limits().is_err(), "{hours} {gib}");
        }
        let kept = |days| Storage {
            audit_days: Some(days),
            ..storage(24.0, 2.0)
        };
        let limits = kept(400.0).limits().expect("good");
        assert_eq!(limits.keep_audit, Some(Duration::from_secs(400 * 86_400)));
        assert!(kept(-1.0).limits().is_err());
        let limited = |gib| Storage {
            max_objects_gib: Some(gib),
            ..storage(24.0, 2.0)
        };
        let limits = limited(3.0).limits().expect("good");
        assert_eq!(limits.limit_bytes, Some(3 << 30));
        for gib in [2.0, -1.0, f64::NAN] {
            assert!(limited(gib).limits().is_err(), "{gib}");
        }
    }
}
