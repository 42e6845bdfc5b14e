//! The workers that have asked for jobs lately.
//!
//! Workers ask every second, mostly without success, so this is kept in memory: a row would cost a
//! disk access each time.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, SystemTime};

/// Silence after which a worker is forgotten.
const FORGET_AFTER: Duration = Duration::from_secs(600);

/// When each worker asked last, by id.
#[derive(Debug, Default)]
pub struct Roster {
    seen: Mutex<HashMap<String, SystemTime>>,
}

impl Roster {
    /// The worker asked for a job at `now`.
    pub fn asked(&self, worker_id: &str, now: SystemTime) {
        let mut seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        seen.retain(|_, last| {
            now.duration_since(*last)
                .is_ok_and(|silence| silence < FORGET_AFTER)
        });
        seen.insert(worker_id.to_owned(), now);
    }

    /// The workers that are not forgotten at `now`, with their last request.
    pub fn lately(&self, now: SystemTime) -> HashMap<String, SystemTime> {
        let seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        let known = seen.iter().filter(|(_, last)| {
            // A clock that was set back must not hide a worker.
            now.duration_since(**last)
                .map_or(true, |silence| silence < FORGET_AFTER)
        });
        known.map(|(id, last)| (id.clone(), *last)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_silent_worker_is_forgotten() {
        let roster = Roster::default();
        let start = SystemTime::UNIX_EPOCH + FORGET_AFTER;
        roster.asked("a", start);
        roster.asked("b", start + FORGET_AFTER / 2);
        assert_eq!(roster.lately(start + FORGET_AFTER / 2).len(), 2);
        let later = roster.lately(start + FORGET_AFTER);
        assert_eq!(later.keys().collect::<Vec<_>>(), ["b"]);
    }
}
