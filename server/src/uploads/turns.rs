//! One writer of an upload at a time: the newest. A connection may be lost long before the service
//! notices, and whoever goes on elsewhere must not wait for that.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::OwnedMutexGuard;
use tokio_util::sync::CancellationToken;

type Lock = Arc<tokio::sync::Mutex<()>>;

/// The uploads that are written or read to their end, by id.
#[derive(Debug, Default, Clone)]
pub struct Turns {
    taken: Arc<Mutex<HashMap<String, Taken>>>,
}

#[derive(Debug, Default)]
struct Taken {
    lock: Lock,
    /// Of the newest turn.
    stop: CancellationToken,
}

/// The right to change an upload, until it is dropped.
#[derive(Debug)]
pub struct Turn {
    id: String,
    turns: Turns,
    lock: Lock,
    stop: CancellationToken,
    guard: Option<OwnedMutexGuard<()>>,
}

impl Turns {
    /// Asks whoever has the upload `id` to stop, and waits until it has.
    pub async fn take(&self, id: &str) -> Turn {
        let (lock, stop) = {
            let mut taken = self.taken.lock().unwrap_or_else(PoisonError::into_inner);
            let entry = taken.entry(id.to_owned()).or_default();
            entry.stop.cancel();
            entry.stop = CancellationToken::new();
            (Arc::clone(&entry.lock), entry.stop.clone())
        };
        let mut turn = Turn {
            id: id.to_owned(),
            turns: self.clone(),
            lock: Arc::clone(&lock),
            stop,
            guard: None,
        };
        // A caller that goes away while it waits leaves through the same door.
        turn.guard = Some(lock.lock_owned().await);
        turn
    }
}

impl Turn {
    /// Ready once somebody else wants the upload.
    pub async fn stopped(&self) {
        self.stop.cancelled().await;
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        self.guard = None;
        let taken = self.turns.taken.lock();
        let mut taken = taken.unwrap_or_else(PoisonError::into_inner);
        // One reference is the map's, one is this turn's; another turn has at least one more.
        if Arc::strong_count(&self.lock) <= 2 {
            taken.remove(&self.id);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn the_newest_turn_ends_the_others_and_nothing_is_left() {
        let turns = Turns::default();
        let first = turns.take("u").await;
        let other = turns.take("v").await;
        let next = tokio::spawn({
            let turns = turns.clone();
            async move { turns.take("u").await }
        });
        first.stopped().await;
        assert!(!next.is_finished(), "the first one still has it");
        drop(first);
        let second = next.await.expect("no panic");
        assert!(!second.stop.is_cancelled() && !other.stop.is_cancelled());
        drop((second, other));
        assert!(turns.taken.lock().expect("no panic").is_empty());
    }
}
