//! Whether connections were lost lately. A restart of the database ends all of them, but each tells so only when it is used.

use super::failures::is_lost;
use sqlx::Error;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Time after a loss in which others are expected.
const WARY: Duration = Duration::from_secs(10);

/// When a connection was last lost, shared by all that use the pool.
#[derive(Debug, Clone, Default)]
pub(super) struct LastLoss(Arc<Mutex<Option<Instant>>>);

impl LastLoss {
    /// Notes the time if `result` tells that the connection leads nowhere, and returns it.
    pub(super) fn noted<T>(&self, result: Result<T, Error>) -> Result<T, Error> {
        if result.as_ref().is_err_and(is_lost) {
            *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
        }
        result
    }

    /// Whether the others are to be tested before they are used.
    pub(super) fn is_recent(&self) -> bool {
        let last = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        last.is_some_and(|it| it.elapsed() < WARY)
    }
}
