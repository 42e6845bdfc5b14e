//! The clock of the service. All times come from the coordinator, or from its database if other coordinators can have that
//! too, and never from a worker.

use std::fmt::Debug;
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// A clock, in seconds since 1970. Nothing else in the service reads the system's time.
pub trait Clock: Debug + Send + Sync {
    /// The current time. It can jump: the system's clock can be set.
    fn now(&self) -> f64;

    /// Seconds since some moment of this process, on a monotonic clock.
    fn steady(&self) -> f64;

    /// Whether this is the system's clock, which a database that has a clock of its own replaces.
    fn is_system(&self) -> bool {
        false
    }

    /// [`Clock::now`] as a [`SystemTime`].
    fn time(&self) -> SystemTime {
        // Times before 1970 become 1970.
        let since = Duration::try_from_secs_f64(self.now()).unwrap_or_default();
        UNIX_EPOCH + since
    }
}

/// The system's clock. `now` can be set, and advances while the machine sleeps; `steady` stops then.
#[derive(Debug, Clone, Copy, Default)]
pub struct SystemClock;

impl Clock for SystemClock {
    #[expect(
        clippy::disallowed_methods,
        reason = "the only place that reads the system's time"
    )]
    fn now(&self) -> f64 {
        let since = SystemTime::now().duration_since(UNIX_EPOCH);
        // Times before 1970 become 1970.
        since.map_or(0.0, |since| since.as_secs_f64())
    }

    fn is_system(&self) -> bool {
        true
    }

    fn steady(&self) -> f64 {
        static BEGAN: OnceLock<Instant> = OnceLock::new();
        BEGAN.get_or_init(Instant::now).elapsed().as_secs_f64()
    }
}

/// A clock for tests, which moves only when it is told to.
#[derive(Debug)]
pub struct ManualClock(Mutex<Hands>);

#[derive(Debug)]
struct Hands {
    now: f64,
    steady: f64,
}

impl ManualClock {
    /// A clock at `now`.
    pub fn at(now: f64) -> Self {
        Self(Mutex::new(Hands { now, steady: 0.0 }))
    }

    /// Lets `seconds` pass on both clocks.
    pub fn advance(&self, seconds: f64) {
        self.moved(seconds, seconds);
    }

    /// Sets the clock ahead by `seconds`, or back if they are negative. No time passes.
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
