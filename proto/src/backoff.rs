//! Pauses between attempts.

use std::hash::{BuildHasher, RandomState};
use std::time::Duration;

/// Random share by which a pause is longer or shorter, so that clients that one fault stopped do not all return
/// at once.
const JITTER: f64 = 0.2;

/// Pauses that double from a first to a longest one.
#[derive(Debug, Clone)]
pub struct Backoff {
    first: Duration,
    longest: Duration,
    next: Duration,
}

impl Backoff {
    /// Starts at `first` and never waits longer than `longest`, jitter aside.
    pub fn new(first: Duration, longest: Duration) -> Self {
        Self {
            first,
            longest,
            next: first.min(longest),
        }
    }

    /// The pause to make now, give or take a fifth; the next one is twice as long.
    pub fn pause(&mut self) -> Duration {
        self.steady().mul_f64(jitter())
    }

    /// The pause without its jitter.
    fn steady(&mut self) -> Duration {
        let pause = self.next;
        self.next = (pause * 2).min(self.longest);
        pause
    }

    /// Resets the pause, after a success.
    pub fn reset(&mut self) {
        self.next = self.first.min(self.longest);
    }
}

/// A random factor of a pause, within a fifth of 1.
pub fn jitter() -> f64 {
    // The standard library's hash maps get their keys from the system's random numbers.
    let bits = RandomState::new().hash_one(()) as u32;
    let chance = f64::from(bits) / f64::from(u32::MAX);
    1.0 + JITTER * (2.0 * chance - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_double_up_to_the_longest_and_start_over() {
        let ms = Duration::from_millis;
        let mut backoff = Backoff::new(ms(200), ms(500));
        let pauses: Vec<_> = (0..4).map(|_| backoff.steady()).collect();
        assert_eq!(pauses, [ms(200), ms(400), ms(500), ms(500)]);
        backoff.reset();
        assert_eq!(backoff.steady(), ms(200));
        backoff.reset();
        let pauses: Vec<_> = (0..32).map(|_| backoff.pause()).collect();
        let last = &pauses[2..];
        assert!(last.iter().all(|pause| (ms(400)..=ms(600)).contains(pause)));
        assert!(last.iter().max() > last.iter().min(), "they differ");
    }

    #[test]
    fn chance_is_spread_evenly() {
        let drawn: Vec<f64> = (0..4000).map(|_| jitter()).collect();
        assert!(drawn.iter().all(|it| (0.8..=1.2).contains(it)));
        let mean = drawn.iter().sum::<f64>() / drawn.len() as f64;
        assert!((mean - 1.0).abs() < 0.02, "{mean}");
        let low = drawn.iter().filter(|it| **it < 0.9).count();
        assert!(
            (800..1200).contains(&low),
            "{low} of 4000 in the lowest quarter"
        );
    }
}
