//! Parts of the service, each a task: how they end, and within what time.

use super::EmbeddedError;
use std::time::Duration;
use tokio::task::{JoinError, JoinHandle};

/// How a part ends.
pub(super) type Outcome<E> = Result<(), E>;

/// The reason for an unexpected end of a part; never returns while the part runs, or without a part.
pub(super) async fn ended_early<E>(
    part: &mut Option<JoinHandle<Outcome<E>>>,
    name: &'static str,
) -> EmbeddedError
where
    EmbeddedError: From<E>,
{
    let Some(handle) = part else {
        return std::future::pending().await;
    };
    let ended = handle.await;
    // A finished task must not be awaited again by `shutdown`.
    *part = None;
    outcome(ended, name)
        .err()
        .unwrap_or(EmbeddedError::Ended(name))
}

/// Outcome of a part, which must end within `limit`.
pub(super) async fn joined<E>(
    part: Option<JoinHandle<Outcome<E>>>,
    name: &'static str,
    limit: Duration,
) -> Result<(), EmbeddedError>
where
    EmbeddedError: From<E>,
{
    let Some(mut handle) = part else {
        return Ok(());
    };
    match tokio::time::timeout(limit, &mut handle).await {
        Ok(ended) => outcome(ended, name),
        Err(_) => {
            handle.abort();
            Err(EmbeddedError::TimedOut(name))
        }
    }
}

fn outcome<E>(ended: Result<Outcome<E>, JoinError>, part: &'static str) -> Result<(), EmbeddedError>
where
    EmbeddedError: From<E>,
{
    ended
        .map_err(|source| EmbeddedError::Broken { part, source })?
        .map_err(EmbeddedError::from)
}
