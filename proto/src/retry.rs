//! Which failures of a call justify another attempt. There is one list, since client, workers and coordinator meet the same
//! failures; each of them decides how long it tries.

use tonic::Code;

/// The cause of a failed call, as far as its status code tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FailureCause {
    /// The connection, or a process at its other end that has just ended: the same call may succeed at once, perhaps at another
    /// address.
    Connection,
    /// The service, which is full or has lost data: the same call may succeed after somebody has acted.
    Service,
    /// The call: it fails again unless the call changes.
    Call,
}

/// The cause of a failure with `code`. An answer of our service also has a reason, which says more
/// ([`crate::reasons`]).
pub fn failure_cause(code: Code) -> FailureCause {
    match code {
        // The service ends or has ended, or nothing listens.
        Code::Unavailable
        // The stream was reset: by a proxy, or by a service that ends.
        | Code::Cancelled
        // An error below gRPC: tonic has no other code for a broken connection.
        | Code::Unknown
        // HTTP/2 was violated, as by an answer that was cut off.
        | Code::Internal
        // A proxy gave up, or a database rolled the call back.
        | Code::Aborted
        // The other end is silent, which a frozen process is as well.
        | Code::DeadlineExceeded => FailureCause::Connection,
        // No space, too many calls, or a quota that is used up.
        Code::ResourceExhausted
        // Stored bytes are lost or altered; an operator may put them back.
        | Code::DataLoss
        // A failure with the code of a success is nothing that the call has caused.
        | Code::Ok => FailureCause::Service,
        // The call is wrong in itself.
        Code::InvalidArgument
        // tonic: a message is larger than its receiver reads.
        | Code::OutOfRange
        // The call names what is not there, or is there already.
        | Code::NotFound
        | Code::AlreadyExists
        // The state of what it names forbids it.
        | Code::FailedPrecondition
        // The caller may not make it.
        | Code::PermissionDenied
        | Code::Unauthenticated
        // The service is of a version without it.
        | Code::Unimplemented => FailureCause::Call,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_broken_connection_is_no_fault_of_the_call() {
        for code in [Code::Unavailable, Code::Unknown, Code::Aborted] {
            assert_eq!(failure_cause(code), FailureCause::Connection, "{code:?}");
        }
        for code in [Code::NotFound, Code::OutOfRange, Code::Unauthenticated] {
            assert_eq!(failure_cause(code), FailureCause::Call, "{code:?}");
        }
        assert_eq!(
            failure_cause(Code::ResourceExhausted),
            FailureCause::Service
        );
    }
}
