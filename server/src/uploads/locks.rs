//! One writer of an upload at a time in this process: the newest. A connection may be lost long before the service
//! notices, and a client that reconnects must not wait for that.
//!
//! This lets the older call commit what has arrived before the newer one begins. That only the newest commits, whichever
//! coordinator it calls, is decided by the number of the writer in the upload's row.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::OwnedMutexGuard;
use tokio_util::sync::CancellationToken;

type SharedMutex = Arc<tokio::sync::Mutex<()>>;

/// The locks of the uploads that a call writes, or whose last bytes it waits for, by upload id.
#[derive(Debug, Default, Clone)]
pub(crate) struct UploadLocks {
    held: Arc<Mutex<HashMap<String, Held>>>,
}

#[derive(Debug, Default)]
struct Held {
    mutex: SharedMutex,
    /// Tells the newest holder to stop.
    stop: CancellationToken,
}

/// The exclusive right to change an upload, until it is dropped.
#[derive(Debug)]
pub(crate) struct UploadLock {
    id: String,
    locks: UploadLocks,
    mutex: SharedMutex,
    stop: CancellationToken,
    guard: Option<OwnedMutexGuard<()>>,
}

impl UploadLocks {
    /// Asks the call that holds the lock of the upload `id` to stop, and waits until it has.
    pub(crate) async fn acquire(&self, id: &str) -> UploadLock {
        let (mutex, stop) = {
            let mut held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
            let entry = held.entry(id.to_owned()).or_default();
            entry.stop.cancel();
            entry.stop = CancellationToken::new();
            (Arc::clone(&entry.mutex), entry.stop.clone())
        };
        // Made before the wait: a call that is cancelled while it waits drops the lock as well.
        let mut lock = UploadLock {
            id: id.to_owned(),
            locks: self.clone(),
            mutex: Arc::clone(&mutex),
            stop,
            guard: None,
        };
        lock.guard = Some(mutex.lock_owned().await);
        lock
    }
}

impl UploadLock {
    /// Ready once another call waits for the lock.
    pub(crate) async fn wanted(&self) {
        self.stop.cancelled().await;
    }
}

impl Drop for UploadLock {
    fn drop(&mut self) {
        self.guard = None;
        let held = self.locks.held.lock();
        let mut held = held.unwrap_or_else(PoisonError::into_inner);
        // One reference is the map's, one is this lock's; another holder or waiter has at least one more.
        if Arc::strong_count(&self.mutex) <= 2 {
            held.remove(&self.id);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn the_newest_call_stops_the_others_and_nothing_is_left() {
        let locks = UploadLocks::default();
        let first = locks.acquire("u").await;
        let other = locks.acquire("v").await;
        let next = tokio::spawn({
            let locks = locks.clone();
            async move { locks.acquire("u").await }
        });
        first.wanted().await;
        assert!(!next.is_finished(), "the first one still has it");
        drop(first);
        let second = next.await.expect("no panic");
        assert!(!second.stop.is_cancelled() && !other.stop.is_cancelled());
        drop((second, other));
        assert!(locks.held.lock().expect("no panic").is_empty());
    }
}
