//! The service in one process, as `yoto serve` runs it.

use super::asked_to_stop;
use anyhow::Result;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use yoto::embedded::{Embedded, EmbeddedOptions};
use yoto_server::{ServerConfig, StorageLimits};

/// Serves and works until SIGTERM.
pub(super) async fn run(data: PathBuf, port: u16) -> Result<()> {
    let server = ServerConfig {
        storage: StorageLimits {
            min_free_bytes: 0,
            ..StorageLimits::default()
        },
        ..ServerConfig::new(data)
    };
    let options = EmbeddedOptions {
        listen: Some(SocketAddr::from((Ipv4Addr::LOCALHOST, port))),
        ..EmbeddedOptions::new(server)
    };
    let mut service = Embedded::start(options).await?;
    tokio::select! {
        () = asked_to_stop() => {}
        error = service.failed() => return Err(error.into()),
    }
    Ok(service.shutdown().await?)
}
