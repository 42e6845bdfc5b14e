//! Waits of jobs that failed through no fault of their own.

use yoto_proto::backoff::jitter;

/// Number of retries after faults outside the job: over about a day, so that a store or a
/// machine can be repaired meanwhile.
pub const MAX_RETRIES: u32 = 100;
/// Maximum wait before a retry without jitter, seconds. The first wait is one second, and each later one doubles.
pub const LONGEST_WAIT: f64 = 900.0;

/// Seconds until the next attempt of a job after `retries` retries, with a random jitter of ±20 %; `None` after
/// the last retry.
pub fn wait(retries: u32) -> Option<f64> {
    Some(steady_wait(retries)? * jitter())
}

/// The wait without its jitter.
fn steady_wait(retries: u32) -> Option<f64> {
    (retries < MAX_RETRIES).then(|| f64::from(retries).exp2().min(LONGEST_WAIT))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_double_up_to_the_longest_for_about_a_day() {
        let waits: Vec<f64> = (0..MAX_RETRIES).filter_map(steady_wait).collect();
        assert_eq!(waits[..4], [1.0, 2.0, 4.0, 8.0]);
        assert_eq!(waits[10..].iter().copied().fold(0.0, f64::max), 900.0);
        let hours = waits.iter().sum::<f64>() / 3600.0;
        assert!((20.0..28.0).contains(&hours), "{hours} hours");
        assert_eq!(steady_wait(MAX_RETRIES), None);
    }

    #[test]
    fn jobs_that_wait_for_the_same_fault_do_not_return_together() {
        let waits: Vec<f64> = (0..64).filter_map(|_| wait(5)).collect();
        assert!(waits.iter().all(|wait| (25.6..=38.4).contains(wait)));
        let apart = waits.iter().copied().fold(0.0, f64::max)
            - waits.iter().copied().fold(f64::MAX, f64::min);
        assert!(apart > 1.0, "{apart} s apart");
    }
}
