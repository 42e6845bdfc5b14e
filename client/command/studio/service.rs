//! The service of one command, for as long as its work lasts.

use crate::embedded::{Embedded, EmbeddedOptions};
use anyhow::Context;
use std::path::{Path, PathBuf};
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_client::YotoClient;
use yoto_ingest::IngestSettings;
use yoto_server::ServerConfig;

/// Starts a service on the folder `data`, which reads uploads as `ingest` says, does `work` with a
/// client of it, and stops the service.
///
/// # Errors
/// When the work fails, the service fails or can't start, or the user interrupts.
pub(crate) async fn with_service<T>(
    data: PathBuf,
    ingest: IngestSettings,
    lpips: Option<LpipsWeights>,
    work: impl AsyncFnOnce(&YotoClient) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    close_to_others(&data)?;
    let mut service = Embedded::start(EmbeddedOptions {
        ingest,
        lpips,
        ..EmbeddedOptions::new(ServerConfig::new(data))
    })
    .await
    .context("starting the embedded service")?;
    detail!("computing on {}", service.device());
    if let Some(hint) = yoto_device::hint_on_cpu() {
        tell!("{hint}");
    }
    let client = service.client();
    let outcome = tokio::select! {
        outcome = work(&client) => outcome,
        failed = service.failed() => Err(failed.into()),
        interrupted = tokio::signal::ctrl_c() => {
            interrupted?;
            Err(anyhow::anyhow!("interrupted"))
        }
    };
    let stopped = service
        .shutdown()
        .await
        .context("stopping the embedded service");
    let done = outcome?;
    stopped?;
    Ok(done)
}

/// Makes a command's data folder private to its user; the service does so only with folders that it creates.
fn close_to_others(data: &Path) -> anyhow::Result<()> {
    #[cfg(unix)]
    if data.is_dir() {
        let own = std::os::unix::fs::PermissionsExt::from_mode(0o700);
        std::fs::set_permissions(data, own)
            .with_context(|| format!("closing {} to other users", data.display()))?;
    }
    Ok(())
}
