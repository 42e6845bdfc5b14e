//! The clock of leases: always the coordinator's, never a worker's.

use std::fmt::Debug;
use std::sync::{Mutex, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

/// A clock; seconds since 1970.
pub trait Clock: Debug + Send + Sync {
    /// The time now.
    fn now(&self) -> f64;
}

/// The system's clock. It may be set, and it stands still while the machine sleeps.
#[derive(Debug, Clone, Copy, Default)]
pub struct SystemClock;

impl Clock for SystemClock {
    fn now(&self) -> f64 {
        let since = SystemTime::now().duration_since(UNIX_EPOCH);
        // Before 1970 there were no leases.
        since.map_or(0.0, |since| since.as_secs_f64())
    }
}

/// A clock that moves only on request, so that tests of leases need not wait.
#[derive(Debug)]
pub struct ManualClock(Mutex<f64>);

impl ManualClock {
    /// A clock that shows `now`.
    pub fn at(now: f64) -> Self {
        Self(Mutex::new(now))
    }

    /// Moves the clock, backwards as well.
    pub fn advance(&self, seconds: f64) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) += seconds;
    }
}

impl Clock for ManualClock {
    fn now(&self) -> f64 {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
