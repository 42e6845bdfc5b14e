//! Hints from and to other coordinators of the same database.

use super::super::Notifier;
use super::message::{Heard, heard, texts};
use std::mem;
use std::sync::atomic::Ordering;
use std::sync::{Arc, PoisonError};
use std::time::Duration;
use yoto_store::StoreError;

/// Time between two sendings: PostgreSQL commits those of all coordinators one after the other.
const BETWEEN: Duration = Duration::from_millis(20);
/// Time after which a broken connection is opened again.
const RETRY: Duration = Duration::from_secs(1);

/// Sends hints until the coordinator stops: the first at once, and those that come soon after it together.
pub(crate) async fn send(notifier: Arc<Notifier>) {
    let Some(outgoing) = &notifier.hints.outgoing else {
        return;
    };
    loop {
        tokio::select! {
            () = notifier.stop.cancelled() => return,
            () = outgoing.news.notified() => {}
        }
        let hints = mem::take(
            &mut *outgoing
                .hints
                .lock()
                .unwrap_or_else(PoisonError::into_inner),
        );
        if hints.is_empty() {
            continue;
        }
        for text in texts(&notifier.instance, &hints) {
            if let Err(error) = notifier.store.notify(&text).await {
                tracing::debug!(%error, "hints for other coordinators are lost");
                break;
            }
        }
        tokio::select! {
            () = notifier.stop.cancelled() => return,
            () = tokio::time::sleep(BETWEEN) => {}
        }
    }
}

/// Passes on hints of other coordinators until this one stops.
pub(crate) async fn listen(notifier: Arc<Notifier>) {
    loop {
        let ended = tokio::select! {
            () = notifier.stop.cancelled() => return,
            ended = pass_on(&notifier) => ended,
        };
        notifier.hints.listening.store(false, Ordering::Relaxed);
        let Err(error) = ended else {
            return;
        };
        tracing::debug!(%error, "hints of other coordinators are not heard");
        tokio::select! {
            () = notifier.stop.cancelled() => return,
            () = tokio::time::sleep(RETRY) => {}
        }
    }
}

/// Passes on hints until the connection fails. Returns at once if the database has no other coordinators.
async fn pass_on(notifier: &Notifier) -> Result<(), StoreError> {
    let Some(mut listener) = notifier.store.listen().await? else {
        return Ok(());
    };
    notifier.hints.listening.store(true, Ordering::Relaxed);
    loop {
        let Some(text) = listener.next().await? else {
            tracing::debug!("some hints of other coordinators may be lost");
            continue;
        };
        let faults = notifier.faults.as_ref();
        if faults.is_some_and(|faults| !faults.hears()) {
            continue;
        }
        for hint in heard(&notifier.instance, &text) {
            match hint {
                Heard::Changed(job) => notifier.changes.announce(&job),
                Heard::Queued(tenant, kind, count) => {
                    (0..count).for_each(|_| notifier.hints.waiting.wake(&tenant, kind));
                }
            }
        }
    }
}
