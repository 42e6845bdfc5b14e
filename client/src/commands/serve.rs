//! `yoto serve`: coordinator and worker in one process.

use crate::embedded::{Embedded, EmbeddedOptions};
use anyhow::Context;
use clap::Args;
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::PathBuf;

const AFTER_HELP: &str = "\
All state of the service is in the data folder: an SQLite database and the objects (uploads,
checkpoints, renders). Only one process can serve a folder at a time.

SIGTERM or ctrl-c: no new jobs start, a training job saves a checkpoint and returns to the
queue, and the process ends, even with connected clients.

Examples:
  yoto serve
  yoto serve --data /srv/yoto --listen 127.0.0.1:6000
  grpcurl -plaintext 127.0.0.1:50051 list";

/// Run the service on this machine: API, jobs, storage and a worker.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct Serve {
    /// Folder for database and objects; created if missing.
    #[arg(long, value_name = "DIR", default_value = "./yoto-data")]
    data: PathBuf,
    /// Address to listen at: host and port.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:50051", value_parser = address)]
    listen: SocketAddr,
    /// Run no worker: jobs wait for a worker in another process.
    #[arg(long)]
    no_worker: bool,
    /// Listen beyond this machine without encryption or keys: anyone who can reach the
    /// address can read and change everything.
    #[arg(long)]
    insecure: bool,
    #[command(flatten)]
    pub(super) logs: super::LogArgs,
    #[command(flatten)]
    ingest: super::ingest_args::IngestArgs,
    #[command(flatten)]
    lpips: super::lpips_args::LpipsArgs,
}

impl Serve {
    pub(super) async fn run(self) -> anyhow::Result<()> {
        check_exposure(self.listen, self.insecure)?;
        let options = EmbeddedOptions {
            data: self.data.clone(),
            listen: Some(self.listen),
            worker: !self.no_worker,
            ingest: self.ingest.settings(),
            lpips: self.lpips.weights()?,
        };
        let mut service = Embedded::start(options)
            .await
            .with_context(|| format!("starting the service in {}", self.data.display()))?;
        if let Some(address) = service.address() {
            tell!("yoto serves http://{address} from {}", self.data.display());
            tell!("objects at {}", service.objects_url());
        }
        if !self.no_worker {
            tell!("computing on {}", service.device());
            if let Some(hint) = yoto_device::hint_on_cpu() {
                tell!("{hint}");
            }
        }
        let failure = tokio::select! {
            asked = asked_to_stop() => asked.context("listening for signals").err(),
            failed = service.failed() => Some(failed.into()),
        };
        tell!("stopping");
        service.shutdown().await.context("stopping the service")?;
        failure.map_or(Ok(()), Err)
    }
}

/// Parses an address, or looks a name up.
fn address(text: &str) -> Result<SocketAddr, String> {
    let found = text.to_socket_addrs();
    let mut found = found.map_err(|error| format!("{error}; an address is HOST:PORT"))?;
    found
        .next()
        .ok_or_else(|| "the name has no address".to_owned())
}

/// Without TLS and keys, the service is for this machine only.
fn check_exposure(listen: SocketAddr, insecure: bool) -> anyhow::Result<()> {
    anyhow::ensure!(
        listen.ip().is_loopback() || insecure,
        "{listen} can be reached from other machines, and nothing would guard it: \
         listen at 127.0.0.1, or add --insecure if the network is trusted"
    );
    Ok(())
}

/// Returns at SIGTERM or ctrl-c.
pub(super) async fn asked_to_stop() -> std::io::Result<()> {
    #[cfg(unix)]
    {
        use tokio::signal::unix::{SignalKind, signal};
        let mut terminate = signal(SignalKind::terminate())?;
        tokio::select! {
            _ = terminate.recv() => Ok(()),
            interrupted = tokio::signal::ctrl_c() => interrupted,
        }
    }
    #[cfg(not(unix))]
    tokio::signal::ctrl_c().await
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
    fn only_loopback_needs_no_flag() {
        let address = |text: &str| text.parse::<SocketAddr>().expect("an address");
        assert!(check_exposure(address("127.0.0.1:1"), false).is_ok());
        assert!(check_exposure(address("[::1]:1"), false).is_ok());
        assert!(check_exposure(address("0.0.0.0:1"), false).is_err());
        assert!(check_exposure(address("0.0.0.0:1"), true).is_ok());
    }
}
