//! The way of entries from calls to the task that writes them.

use super::budget::Budget;
use tokio::sync::{mpsc, oneshot};
use yoto_request::RequestError;
use yoto_store::NewAuditEntry;

/// Most entries of one transaction, and most that wait.
pub(super) const BATCH: usize = 256;

/// An entry to write, and who waits for it.
pub(super) struct QueuedEntry {
    pub(super) entry: NewAuditEntry,
    /// Gets the entry's number. Without it the entry was not written.
    pub(super) written: Option<oneshot::Sender<u64>>,
}

/// The way to the writer.
#[derive(Debug)]
pub(crate) struct Audit {
    /// How many refused calls are listed.
    pub(super) budget: Budget,
    sender: mpsc::Sender<QueuedEntry>,
    receiver: tokio::sync::Mutex<Option<mpsc::Receiver<QueuedEntry>>>,
}

impl std::fmt::Debug for QueuedEntry {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.entry.fmt(out)
    }
}

impl Audit {
    /// The way to a writer, with budgets of `refused_calls` for each key.
    pub(crate) fn new(refused_calls: u32) -> Self {
        let (sender, receiver) = mpsc::channel(BATCH);
        Self {
            budget: Budget::new(refused_calls),
            sender,
            receiver: tokio::sync::Mutex::new(Some(receiver)),
        }
    }

    /// The end at which entries arrive, once.
    pub(super) async fn receiver(&self) -> Option<mpsc::Receiver<QueuedEntry>> {
        self.receiver.lock().await.take()
    }

    /// Writes that a call begins, and returns the entry's number.
    ///
    /// # Errors
    /// When the entry can't be written: the call must not begin.
    pub(crate) async fn begin(&self, entry: NewAuditEntry) -> Result<u64, RequestError> {
        let (written, number) = oneshot::channel();
        let wanted = QueuedEntry {
            entry,
            written: Some(written),
        };
        let sent = self.sender.send(wanted).await;
        sent.map_err(|_| RequestError::ShuttingDown)?;
        number.await.map_err(|_| RequestError::NotAudited)
    }

    /// Writes that a call has ended, some time later.
    pub(crate) async fn end(&self, entry: NewAuditEntry) {
        let wanted = QueuedEntry {
            entry,
            written: None,
        };
        if self.sender.send(wanted).await.is_err() {
            tracing::warn!("the service ends before a call's end is in its audit log");
        }
    }

    /// [`Self::end`] for a caller who can't wait. The entry is lost if too many wait already.
    pub(crate) fn end_now(&self, entry: NewAuditEntry) {
        let wanted = QueuedEntry {
            entry,
            written: None,
        };
        if self.sender.try_send(wanted).is_err() {
            tracing::warn!("the end of a call that was cut off is not in the audit log");
        }
    }
}
