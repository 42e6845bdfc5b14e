//! The service in one process, as `yoto serve` runs it.

use super::asked_to_stop;
use anyhow::Result;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use yoto::embedded::{Embedded, EmbeddedOptions};
use yoto_ingest::IngestSettings;
use yoto_server::StorageLimits;

/// Serves and works until SIGTERM.
pub async fn run(data: PathBuf, port: u16) -> Result<()> {
    let options = EmbeddedOptions {
        data,
        database: None,
        objects: None,
        listen: Some(SocketAddr::from((Ipv4Addr::LOCALHOST, port))),
        admission: yoto_server::Admission::Machine,
        tls: None,
        worker: true,
        scratch: None,
        drain: std::time::Duration::ZERO,
        otlp: None,
        ingest: IngestSettings::default(),
        lpips: None,
        require_consent: false,
        allow_origins: Vec::new(),
        private_webhooks: false,
        oidc: None,
        signed_urls: None,
        storage: StorageLimits {
            min_free_bytes: 0,
            ..StorageLimits::default()
        },
    };
    let mut service = Embedded::start(options).await?;
    tokio::select! {
        () = asked_to_stop() => {}
        error = service.failed() => return Err(error.into()),
    }
    Ok(service.shutdown().await?)
}
