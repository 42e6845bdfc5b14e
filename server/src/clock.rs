//! The clock of the service: always the coordinator's, never a worker's or the database's.

use std::fmt::Debug;
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// A clock; seconds since 1970. Nothing else in the service reads the time of day.
pub trait Clock: Debug + Send + Sync {
    /// The time now. The clock may be set meanwhile.
    fn now(&self) -> f64;

    /// Seconds since a moment of this process, on a clock that nobody can set.
    fn steady(&self) -> f64;

    /// [`Clock::now`] in the type of the standard library.
    fn time(&self) -> SystemTime {
        // Before 1970 there is no service.
        let since = Duration::try_from_secs_f64(self.now()).unwrap_or_default();
        UNIX_EPOCH + since
    }
}

/// The system's clock. It may be set, and it goes on while the machine sleeps; the steady one stands still then.
#[derive(Debug, Clone, Copy, Default)]
pub struct SystemClock;

impl Clock for SystemClock {
    #[expect(clippy::disallowed_methods, reason = "the one place that may")]
    fn now(&self) -> f64 {
        let since = SystemTime::now().duration_since(UNIX_EPOCH);
        // Before 1970 there were no leases.
        since.map_or(0.0, |since| since.as_secs_f64())
    }

    fn steady(&self) -> f64 {
        static BEGAN: OnceLock<Instant> = OnceLock::new();
        BEGAN.get_or_init(Instant::now).elapsed().as_secs_f64()
    }
}

/// A clock that moves only on request, so that tests need not wait.
#[derive(Debug)]
pub struct ManualClock(Mutex<Hands>);

#[derive(Debug)]
struct Hands {
    now: f64,
    steady: f64,
}

impl ManualClock {
    /// A clock that shows `now`.
    pub fn at(now: f64) -> Self {
        Self(Mutex::new(Hands { now, steady: 0.0 }))
    }

    /// Lets time pass.
    pub fn advance(&self, seconds: f64) {
        self.moved(seconds, seconds);
    }

    /// Sets the clock ahead, or back with seconds below 0, while no time passes.
    pub fn set_ahead(&self, seconds: f64) {
        self.moved(seconds, 0.0);
    }

    fn moved(&self, now: f64, steady: f64) {
        let mut hands = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        hands.now += now;
        hands.steady += steady;
    }
}

impl Clock for ManualClock {
    fn now(&self) -> f64 {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).now
    }

    fn steady(&self) -> f64 {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).steady
    }
}
