//! Writes entries in batches: calls at the same time share a transaction, so that a busy service does not wait for the disk once
//! for each.

use super::Audit;
use super::writer::{BATCH, QueuedEntry};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio_util::sync::CancellationToken;
use yoto_store::Store;

/// Interval of the entries that count refused calls.
const COUNT: Duration = Duration::from_secs(60);

/// Longest time for which ends of calls wait for the begin of another one. Nobody waits for them, and a transaction for both is one
/// access to the disk instead of two.
const LINGER: Duration = Duration::from_millis(100);

/// Writes what comes until the service ends, and then what waits.
pub(crate) async fn run(audit: Arc<Audit>, store: Arc<Store>, stop: CancellationToken) {
    let Some(mut receiver) = audit.receiver().await else {
        return;
    };
    let mut batch = Vec::new();
    let mut counts = tokio::time::interval(COUNT);
    // When the first of `batch` came.
    let mut since = tokio::time::Instant::now();
    loop {
        let lingers = !batch.is_empty();
        tokio::select! {
            biased;
            () = tokio::time::sleep_until(since + LINGER), if lingers => write(&store, &mut batch).await,
            got = receiver.recv_many(&mut batch, BATCH) => {
                if got == 0 {
                    write(&store, &mut batch).await;
                    return;
                }
                if !lingers {
                    since = tokio::time::Instant::now();
                }
                let waits = |it: &QueuedEntry| it.written.is_some();
                if batch.len() >= BATCH || batch.iter().any(waits) {
                    write(&store, &mut batch).await;
                }
            }
            _ = counts.tick() => write_counts(&audit, &store).await,
            () = stop.cancelled() => break,
        }
    }
    receiver.close();
    write(&store, &mut batch).await;
    write_counts(&audit, &store).await;
    while receiver.recv_many(&mut batch, BATCH).await > 0 {
        write(&store, &mut batch).await;
    }
}

/// Writes the numbers of calls that were refused without entries of their own.
async fn write_counts(audit: &Audit, store: &Store) {
    let entries = audit.budget.counted(Instant::now());
    if entries.is_empty() {
        return;
    }
    if let Err(error) = store.append_audit(&entries).await {
        tracing::error!(%error, entries = entries.len(), "the audit log can't be written");
    }
}

/// Writes the batch and empties it. If that fails, those who wait learn of it by the end of their channels.
async fn write(store: &Store, batch: &mut Vec<QueuedEntry>) {
    if batch.is_empty() {
        return;
    }
    let (entries, waiting): (Vec<_>, Vec<_>) =
        batch.drain(..).map(|it| (it.entry, it.written)).unzip();
    match store.append_audit(&entries).await {
        Ok(numbers) => {
            for (number, written) in numbers.into_iter().zip(waiting) {
                if let Some(written) = written {
                    // The caller may have gone.
                    let _ = written.send(number);
                }
            }
        }
        Err(error) => {
            tracing::error!(%error, entries = entries.len(), "the audit log can't be written");
        }
    }
}
