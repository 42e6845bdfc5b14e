//! Reasons of refusals: their codes, and the reading of a status. [`ErrorReason`] has them, docs/operate/errors.md explains them.

use crate::v1::ErrorReason;
use tonic::{Code, Status};
use tonic_types::StatusExt;

/// The domain of every `ErrorInfo`.
pub const DOMAIN: &str = "yoto.v1";

/// The gRPC code of a reason.
pub fn code(reason: ErrorReason) -> Code {
    use ErrorReason as R;
    match reason {
        R::Unspecified => Code::Unknown,
        R::InvalidArgument => Code::InvalidArgument,
        R::NotFound => Code::NotFound,
        R::RequestIdReused => Code::AlreadyExists,
        R::Conflict | R::EtagMismatch => Code::Aborted,
        R::Internal => Code::Internal,
        R::Busy | R::ShuttingDown | R::StoreUnavailable => Code::Unavailable,
        R::DiskFull | R::Quota => Code::ResourceExhausted,
        R::ObjectAltered | R::CorruptChunk => Code::DataLoss,
        R::KeyMissing | R::KeyUnknown | R::KeyExpired | R::KeyRevoked => Code::Unauthenticated,
        R::ScopeMissing | R::OtherSite => Code::PermissionDenied,
        R::Draining
        | R::UploadIncomplete
        | R::UploadOffset
        | R::UploadTakenOver
        | R::UploadFinished
        | R::UploadGone
        | R::SubjectNotReady
        | R::NoCapture
        | R::NoSlot
        | R::NoIdentities
        | R::NoCheckpoint
        | R::NotTrained
        | R::TooFewFrames
        | R::NoTradeoff
        | R::ModelFull
        | R::NotRepeatable
        | R::NotSucceeded
        | R::CheckpointTorn
        | R::Consent
        | R::JobOpen
        | R::ModelBusy
        | R::CheckpointBusy
        | R::CaptureBusy
        | R::SubjectBusy
        | R::CaptureInModel
        | R::SubjectInModel
        | R::SlotTrained
        | R::StaleLease
        | R::CancelNotRequested
        | R::OtherPictures => Code::FailedPrecondition,
    }
}

/// The reason that the service gave, as it is spelled; `None` for a status of the transport.
pub fn spelled(status: &Status) -> Option<String> {
    let details = status.get_error_details();
    let info = details.error_info().filter(|it| it.domain == DOMAIN)?;
    Some(info.reason.clone())
}

/// The reason that the service gave; `None` for a status of the transport. A reason of a later version is
/// [`ErrorReason::Unspecified`].
pub fn of(status: &Status) -> Option<ErrorReason> {
    let reason = spelled(status)?;
    Some(ErrorReason::from_str_name(&reason).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;
    use tonic_types::ErrorDetails;

    #[test]
    fn a_status_tells_its_reason_or_that_it_has_none() {
        let told = |reason: &str, domain: &str| {
            let details = ErrorDetails::with_error_info(reason, domain, []);
            of(&Status::with_error_details(Code::Aborted, "", details))
        };
        assert_eq!(told("CONFLICT", DOMAIN), Some(ErrorReason::Conflict));
        assert_eq!(told("OF_TOMORROW", DOMAIN), Some(ErrorReason::Unspecified));
        let details = ErrorDetails::with_error_info("OF_TOMORROW", DOMAIN, []);
        let later = Status::with_error_details(Code::Aborted, "", details);
        assert_eq!(spelled(&later).as_deref(), Some("OF_TOMORROW"));
        assert_eq!(told("CONFLICT", "a.proxy"), None);
        assert_eq!(of(&Status::unavailable("no route")), None);
    }
}
