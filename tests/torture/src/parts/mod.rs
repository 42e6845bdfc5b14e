//! The processes that the torture starts: the program starts itself again as one of these.
//!
//! They are made of the same library parts as the `yoto` command, and read what is to go wrong from the files
//! of [`Controls`].

mod controls;
mod coordinator;
mod disk;
mod embedded;
mod store;
mod worker;

pub(crate) use controls::{Controls, StoreFault};

use clap::{Args, Subcommand};
use std::path::PathBuf;
use tracing_subscriber::EnvFilter;
use url::Url;
use yoto_server::PostgresUrl;

/// A process of the service under torture.
#[derive(Debug, Subcommand)]
pub enum Part {
    /// A coordinator without workers.
    Coordinator(CoordinatorArgs),
    /// A worker.
    Worker {
        /// Addresses of the coordinators.
        #[arg(long)]
        service: String,
        /// Store of the objects.
        #[arg(long)]
        objects: Url,
        /// Display name.
        #[arg(long)]
        name: String,
        /// Folder of the controls.
        #[arg(long)]
        controls: PathBuf,
        /// Largest file that it can write, bytes: a full disk.
        #[arg(long)]
        largest_file: Option<u64>,
    },
    /// Coordinator and workers in one process.
    Embedded {
        /// Data folder.
        #[arg(long)]
        data: PathBuf,
        /// Port on loopback.
        #[arg(long)]
        port: u16,
    },
}

/// The settings of a coordinator.
#[derive(Debug, Args)]
pub struct CoordinatorArgs {
    /// Which of several it is, from 0.
    #[arg(long)]
    number: usize,
    /// Data folder.
    #[arg(long)]
    data: PathBuf,
    /// Port on loopback.
    #[arg(long)]
    port: u16,
    /// Port on loopback at which callers are asked for keys.
    #[arg(long)]
    door: u16,
    /// Length of a lease, seconds.
    #[arg(long)]
    lease_seconds: f64,
    /// Folder of the controls.
    #[arg(long)]
    controls: PathBuf,
    /// Seed of the disturbed calls.
    #[arg(long)]
    seed: u64,
    /// A database of PostgreSQL.
    #[arg(long)]
    database: Option<PostgresUrl>,
    /// Store of the objects.
    #[arg(long)]
    objects: Url,
}

impl Part {
    /// Runs until SIGTERM.
    ///
    /// # Errors
    /// When it can't start, or fails.
    pub async fn run(self) -> anyhow::Result<()> {
        let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("info"));
        tracing_subscriber::fmt()
            .with_env_filter(filter)
            .with_writer(std::io::stderr)
            // On a full disk, writes to the log fail too, and reporting that would panic.
            .log_internal_errors(false)
            .with_ansi(false)
            .init();
        match self {
            Self::Coordinator(settings) => coordinator::run(settings).await,
            Self::Worker {
                service,
                objects,
                name,
                controls,
                largest_file,
            } => {
                worker::run(
                    &service,
                    &objects,
                    name,
                    Controls::of(controls),
                    largest_file,
                )
                .await
            }
            Self::Embedded { data, port } => embedded::run(data, port).await,
        }
    }
}

/// Returns at SIGTERM.
async fn asked_to_stop() {
    use tokio::signal::unix::{SignalKind, signal};
    match signal(SignalKind::terminate()) {
        Ok(mut terminate) => {
            terminate.recv().await;
        }
        Err(error) => tracing::error!(%error, "can't listen for SIGTERM: stopping"),
    }
}
