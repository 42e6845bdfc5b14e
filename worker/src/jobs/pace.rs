//! The time that a job's pieces still take.

use std::time::Instant;

/// The first piece since a count began.
#[derive(Debug, Clone, Copy)]
struct Start {
    at: Instant,
    done: usize,
    total: usize,
}

/// The speed of the current count of pieces.
#[derive(Debug, Default)]
pub(crate) struct Pace {
    start: Option<Start>,
}

impl Pace {
    /// Seconds until all of `total` pieces are done, when `done` are at `now`; 0 while that is unknown.
    /// Another total, or fewer pieces, begin a new count.
    pub(crate) fn seconds_left(&mut self, now: Instant, done: usize, total: usize) -> f64 {
        let same = |start: &Start| start.total == total && start.done <= done;
        let start = *self.start.insert(self.start.filter(same).unwrap_or(Start {
            at: now,
            done,
            total,
        }));
        match done - start.done {
            0 => 0.0,
            pieces => {
                let spent = now.saturating_duration_since(start.at).as_secs_f64();
                spent / pieces as f64 * total.saturating_sub(done) as f64
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn what_is_left_takes_as_long_per_piece_as_what_is_done() {
        let start = Instant::now();
        let at = |seconds| start + Duration::from_secs(seconds);
        let mut pace = Pace::default();
        assert_eq!(pace.seconds_left(at(0), 0, 10), 0.0);
        assert_eq!(pace.seconds_left(at(4), 2, 10), 16.0);
        assert_eq!(pace.seconds_left(at(30), 10, 10), 0.0);
        assert_eq!(pace.seconds_left(at(31), 3, 40), 0.0, "a new count");
        assert_eq!(pace.seconds_left(at(32), 4, 40), 36.0);
    }
}
