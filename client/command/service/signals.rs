//! The signals that ask a process to stop.

/// Returns at SIGTERM or ctrl-c.
pub(crate) async fn asked_to_stop() -> std::io::Result<()> {
    stop_signals()?.await
}

/// Listens for SIGTERM and ctrl-c from now on. The future is ready when one of them has come.
pub(super) fn stop_signals() -> std::io::Result<impl Future<Output = std::io::Result<()>>> {
    #[cfg(unix)]
    {
        use tokio::signal::unix::{SignalKind, signal};
        let mut terminate = signal(SignalKind::terminate())?;
        let mut interrupt = signal(SignalKind::interrupt())?;
        Ok(async move {
            tokio::select! {
                _ = terminate.recv() => Ok(()),
                _ = interrupt.recv() => Ok(()),
            }
        })
    }
    #[cfg(not(unix))]
    Ok(tokio::signal::ctrl_c())
}
