//! Writes entries in batches: calls at the same time share a transaction, so that a busy service does not wait for the disk once
//! for each.

use super::Audit;
use super::writer::{BATCH, QueuedEntry};
use std::sync::Arc;
use tokio_util::sync::CancellationToken;
use yoto_store::Store;

/// Writes what comes until the service ends, and then what waits.
pub(crate) async fn run(audit: Arc<Audit>, store: Arc<Store>, stop: CancellationToken) {
    let Some(mut receiver) = audit.receiver().await else {
        return;
    };
    let mut batch = Vec::new();
    loop {
        let got = tokio::select! {
            biased;
            got = receiver.recv_many(&mut batch, BATCH) => got,
            () = stop.cancelled() => break,
        };
        if got == 0 {
            return;
        }
        write(&store, &mut batch).await;
    }
    receiver.close();
    while receiver.recv_many(&mut batch, BATCH).await > 0 {
        write(&store, &mut batch).await;
    }
}

/// Writes the batch and empties it. If that fails, those who wait learn of it by the end of their channels.
async fn write(store: &Store, batch: &mut Vec<QueuedEntry>) {
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
