//! A smoothed rate, since the speed of a network varies.

use std::time::{Duration, Instant};

/// Interval between two measurements.
const LOOK: Duration = Duration::from_millis(500);
/// Weight of the newest measurement.
const NEWEST: f64 = 0.25;

/// The rate at which a count grows.
#[derive(Debug)]
pub(super) struct Rate {
    seen: (Instant, u64),
    smoothed: Option<f64>,
}

impl Rate {
    /// A count that is 0 at `now`.
    pub(super) fn new(now: Instant) -> Self {
        Self {
            seen: (now, 0),
            smoothed: None,
        }
    }

    /// The count is `count` at `now`.
    pub(super) fn at(&mut self, now: Instant, count: u64) {
        let (before, last) = self.seen;
        let time = now.saturating_duration_since(before);
        if time < LOOK {
            return;
        }
        let newest = count.saturating_sub(last) as f64 / time.as_secs_f64();
        let smoothed = self
            .smoothed
            .map_or(newest, |old| old + NEWEST * (newest - old));
        self.smoothed = Some(smoothed);
        self.seen = (now, count);
    }

    /// Counts per second; none before the first measurement.
    pub(super) fn a_second(&self) -> Option<f64> {
        self.smoothed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_steady_count_has_its_rate_and_a_stutter_moves_it_little() {
        let start = Instant::now();
        let mut rate = Rate::new(start);
        rate.at(start + LOOK / 2, 99);
        assert_eq!(rate.a_second(), None, "too early to tell");
        for look in 1..=4 {
            rate.at(start + LOOK * look, u64::from(look) * 500);
        }
        assert_eq!(rate.a_second(), Some(1000.0));
        rate.at(start + LOOK * 5, 2000);
        assert_eq!(rate.a_second(), Some(750.0));
    }
}
