//! The gRPC answers that justify a retry.

use tonic::{Code, Status};
use yoto_proto::reasons;
use yoto_proto::retry::{FailureCause, failure_cause};
use yoto_proto::v1::ErrorReason;

/// Whether the same call may succeed later. Unlike a client, a worker also waits for a service that is full: nobody watches it,
/// and its job would be lost.
pub(crate) fn is_transient(code: Code) -> bool {
    failure_cause(code) != FailureCause::Call
}

/// Whether the answer was too long for this program to read. The next answer may be shorter.
pub(crate) fn is_unreadable(code: Code) -> bool {
    code == Code::OutOfRange
}

/// Whether the coordinator reports that this lease is lost.
pub(crate) fn is_stale_lease(status: &Status) -> bool {
    let reason = reasons::of(status);
    matches!(
        reason,
        Some(ErrorReason::StaleLease | ErrorReason::NotFound)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use tonic_types::StatusExt;

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
            assert!(!is_transient(code) && !is_unreadable(code), "{code:?}");
        }
        // Otherwise a single job would end one worker after another.
        assert!(is_unreadable(Code::OutOfRange));
    }

    #[test]
    fn a_lease_is_lost_for_a_reason_and_not_for_a_code() {
        let status = |code, reason: &str| {
            let details = tonic_types::ErrorDetails::with_error_info(reason, "yoto.v1", []);
            Status::with_error_details(code, "", details)
        };
        assert!(is_stale_lease(&status(
            Code::FailedPrecondition,
            "STALE_LEASE"
        )));
        assert!(is_stale_lease(&status(Code::NotFound, "NOT_FOUND")));
        let full = status(Code::FailedPrecondition, "CANCEL_NOT_REQUESTED");
        assert!(!is_stale_lease(&full));
        // A proxy in between that knows no such service.
        assert!(!is_stale_lease(&Status::not_found("404")));
    }
}
