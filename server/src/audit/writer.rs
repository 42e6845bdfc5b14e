//! Writes entries in batches: calls at the same time share a transaction, so that a busy service does not wait for the disk once
//! for each.

use crate::context::Context;
use crate::error::RequestError;
use crate::store::NewAuditEntry;
use std::sync::Arc;
use tokio::sync::{mpsc, oneshot};

/// Most entries of one transaction, and most that wait.
const BATCH: usize = 256;

/// An entry to write, and who waits for it.
struct Wanted {
    entry: NewAuditEntry,
    /// Gets the entry's number. Without it the entry was not written.
    written: Option<oneshot::Sender<u64>>,
}

/// The way to the writer.
#[derive(Debug)]
pub struct Audit {
    sender: mpsc::Sender<Wanted>,
    receiver: tokio::sync::Mutex<Option<mpsc::Receiver<Wanted>>>,
}

impl std::fmt::Debug for Wanted {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.entry.fmt(out)
    }
}

impl Default for Audit {
    fn default() -> Self {
        let (sender, receiver) = mpsc::channel(BATCH);
        Self {
            sender,
            receiver: tokio::sync::Mutex::new(Some(receiver)),
        }
    }
}

impl Audit {
    /// Writes that a call begins, and returns the entry's number.
    ///
    /// # Errors
    /// When the entry can't be written: the call must not begin.
    pub async fn begin(&self, entry: NewAuditEntry) -> Result<u64, RequestError> {
        let (written, number) = oneshot::channel();
        let wanted = Wanted {
            entry,
            written: Some(written),
        };
        let sent = self.sender.send(wanted).await;
        sent.map_err(|_| RequestError::ShuttingDown)?;
        number.await.map_err(|_| RequestError::NotAudited)
    }

    /// Writes that a call has ended, some time later.
    pub async fn end(&self, entry: NewAuditEntry) {
        let wanted = Wanted {
            entry,
            written: None,
        };
        if self.sender.send(wanted).await.is_err() {
            tracing::warn!("the service ends before a call's end is in its audit log");
        }
    }

    /// [`Self::end`] for a caller who can't wait. The entry is lost if too many wait already.
    pub fn end_now(&self, entry: NewAuditEntry) {
        let wanted = Wanted {
            entry,
            written: None,
        };
        if self.sender.try_send(wanted).is_err() {
            tracing::warn!("the end of a call that was cut off is not in the audit log");
        }
    }
}

/// Writes what comes until the service ends, and then what waits.
pub async fn run(context: Arc<Context>) {
    let Some(mut receiver) = context.audit.receiver.lock().await.take() else {
        return;
    };
    let mut batch = Vec::new();
    loop {
        let got = tokio::select! {
            biased;
            got = receiver.recv_many(&mut batch, BATCH) => got,
            () = context.stop.cancelled() => break,
        };
        if got == 0 {
            return;
        }
        write(&context, &mut batch).await;
    }
    receiver.close();
    while receiver.recv_many(&mut batch, BATCH).await > 0 {
        write(&context, &mut batch).await;
    }
}

/// Writes the batch and empties it. If that fails, those who wait learn of it by the end of their channels.
async fn write(context: &Context, batch: &mut Vec<Wanted>) {
    let (entries, waiting): (Vec<_>, Vec<_>) =
        batch.drain(..).map(|it| (it.entry, it.written)).unzip();
    match context.store.append_audit(&entries).await {
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
