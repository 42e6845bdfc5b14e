//! Pauses between attempts, and the gRPC answers that justify a retry.

use std::time::Duration;
use tonic::Code;

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

    /// The pause to make now; the next one is twice as long.
    pub(crate) fn pause(&mut self) -> Duration {
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
pub(crate) fn is_stale_lease(code: Code) -> bool {
    matches!(code, Code::FailedPrecondition | Code::NotFound)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_double_up_to_the_longest_and_start_over() {
        let ms = Duration::from_millis;
        let mut backoff = Backoff::new(ms(200), ms(500));
        let pauses: Vec<_> = (0..4).map(|_| backoff.pause()).collect();
        assert_eq!(pauses, [ms(200), ms(400), ms(500), ms(500)]);
        backoff.reset();
        assert_eq!(backoff.pause(), ms(200));
    }

    #[test]
    fn a_broken_connection_is_retried_and_a_refusal_is_not() {
        for code in [
            Code::Unavailable,
            Code::Unknown,
            Code::DeadlineExceeded,
            Code::Cancelled,
        ] {
            assert!(is_transient(code) && !is_stale_lease(code), "{code:?}");
        }
        for code in [Code::FailedPrecondition, Code::NotFound] {
            assert!(!is_transient(code) && is_stale_lease(code), "{code:?}");
        }
        assert!(!is_transient(Code::InvalidArgument) && !is_stale_lease(Code::InvalidArgument));
    }
}
