//! Pauses between attempts, and the gRPC answers that justify a retry.

use std::time::Duration;
use tonic::{Code, Status};
use tonic_types::StatusExt;

/// Share by which a pause is longer or shorter by chance: workers that lost the same coordinator do not
/// all come back at once.
const JITTER: f64 = 0.2;
/// `ErrorInfo.reason` of a claim that is not the job's newest.
const STALE_LEASE: &str = "STALE_LEASE";
/// `ErrorInfo.reason` of a job that was deleted.
const NOT_FOUND: &str = "NOT_FOUND";

/// Pauses that double from a first to a longest one.
#[derive(Debug, Clone)]
pub(crate) struct Backoff {
    first: Duration,
    longest: Duration,
    next: Duration,
}

impl Backoff {
    /// Starts at `first` and never waits longer than `longest`.
    pub(crate) fn new(first: Duration, longest: Duration) -> Self {
        Self {
            first,
            longest,
            next: first.min(longest),
        }
    }

    /// The pause to make now, give or take a fifth; the next one is twice as long.
    pub(crate) fn pause(&mut self) -> Duration {
        self.steady().mul_f64(1.0 + JITTER * (2.0 * chance() - 1.0))
    }

    /// The pause without its jitter.
    fn steady(&mut self) -> Duration {
        let pause = self.next;
        self.next = (pause * 2).min(self.longest);
        pause
    }

    /// Resets the pause, after a success.
    pub(crate) fn reset(&mut self) {
        self.next = self.first.min(self.longest);
    }
}

/// Whether the same call may succeed later: for all codes except answers about the call itself.
///
/// A broken connection surfaces under several codes (UNAVAILABLE, UNKNOWN, CANCELLED,
/// INTERNAL), so the list names the definite refusals instead.
pub(crate) fn is_transient(code: Code) -> bool {
    !matches!(
        code,
        Code::InvalidArgument
            | Code::NotFound
            | Code::AlreadyExists
            | Code::PermissionDenied
            | Code::FailedPrecondition
            | Code::OutOfRange
            | Code::Unimplemented
            | Code::Unauthenticated
    )
}

/// Whether the coordinator reports that this lease is lost.
pub(crate) fn is_stale_lease(status: &Status) -> bool {
    let details = status.get_error_details();
    let reason = details.error_info().map(|info| info.reason.as_str());
    matches!(reason, Some(STALE_LEASE | NOT_FOUND))
}

/// A random number from 0 to 1, of the random bits of a UUID.
fn chance() -> f64 {
    f64::from(uuid::Uuid::new_v4().as_u128() as u32) / f64::from(u32::MAX)
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
    fn a_broken_connection_is_retried_and_a_refusal_is_not() {
        for code in [
            Code::Unavailable,
            Code::Unknown,
            Code::DeadlineExceeded,
            Code::Cancelled,
        ] {
            assert!(is_transient(code), "{code:?}");
        }
        for code in [
            Code::FailedPrecondition,
            Code::NotFound,
            Code::InvalidArgument,
        ] {
            assert!(!is_transient(code), "{code:?}");
        }
    }

    #[test]
    fn a_lease_is_lost_for_a_reason_and_not_for_a_code() {
        let status = |code, reason: &str| {
            let details = tonic_types::ErrorDetails::with_error_info(reason, "yoto.v1", []);
            Status::with_error_details(code, "", details)
        };
        assert!(is_stale_lease(&status(
            Code::FailedPrecondition,
            STALE_LEASE
        )));
        assert!(is_stale_lease(&status(Code::NotFound, NOT_FOUND)));
        let full = status(Code::FailedPrecondition, "CANCEL_NOT_REQUESTED");
        assert!(!is_stale_lease(&full));
        // A proxy in between that knows no such service.
        assert!(!is_stale_lease(&Status::not_found("404")));
    }
}
