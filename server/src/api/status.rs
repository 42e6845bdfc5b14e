//! Errors as clients see them: a gRPC code with `google.rpc` details.
//!
//! Faults of a request are reported in full. Internal errors are logged here, once, and not reported: their
//! details would help attackers, not callers.

use crate::error::RequestError;
use crate::store::StoreError;
use std::collections::HashMap;
use tonic::{Code, Status};
use tonic_types::{ErrorDetails, StatusExt};
use yoto_objects::ObjectsError;
use yoto_proto::limits::beginning;
use yoto_proto::reasons;

/// The domain of every `ErrorInfo`.
const DOMAIN: &str = "yoto.v1";

/// Maximum length of an error's message, bytes. Errors are sent in headers, and gRPC's C core accepts 8 KiB of headers.
/// The message is sent once percent-encoded (up to 3 bytes for each) and twice in Base64 details (4 bytes for 3).
const TEXT_BYTES: usize = 1024;
/// Maximum length of a field's name, or of a metadata value of an error, bytes.
const FIELD_BYTES: usize = 256;

impl From<RequestError> for Status {
    fn from(error: RequestError) -> Self {
        let text = error.to_string();
        match error {
            RequestError::NotFound { name } => {
                status(Code::NotFound, text, reasons::NOT_FOUND, &[("name", name)])
            }
            RequestError::Invalid { field, message } => invalid(text, field, message),
            RequestError::Precondition { reason, .. } => {
                status(Code::FailedPrecondition, text, reason, &[])
            }
            RequestError::DiskFull { free, needed } => {
                let metadata = [("free", free.to_string()), ("needed", needed.to_string())];
                status(Code::ResourceExhausted, text, "DISK_FULL", &metadata)
            }
            RequestError::CorruptChunk { .. } => {
                status(Code::DataLoss, text, reasons::CORRUPT_CHUNK, &[])
            }
            RequestError::Busy(_) => status(Code::Unavailable, text, "BUSY", &[]),
            RequestError::ShuttingDown => status(Code::Unavailable, text, "SHUTTING_DOWN", &[]),
            RequestError::Stream(status) => status,
            error @ RequestError::NoTenant => internal(&error),
            RequestError::Store(error) => store(error),
            RequestError::Objects(error) if error.is_torn() => altered(&error),
            RequestError::Objects(error) if error.is_full() => unavailable(&error),
            RequestError::Objects(error) => internal(&error),
        }
    }
}

fn store(error: StoreError) -> Status {
    let text = error.to_string();
    match error {
        StoreError::NotFound { name } => {
            status(Code::NotFound, text, reasons::NOT_FOUND, &[("name", name)])
        }
        StoreError::RequestIdReused { request_id } => {
            let metadata = [("request_id", request_id)];
            status(Code::AlreadyExists, text, "REQUEST_ID_REUSED", &metadata)
        }
        StoreError::StaleLease { job, token } => {
            let metadata = [("job", job), ("token", token.to_string())];
            status(
                Code::FailedPrecondition,
                text,
                reasons::STALE_LEASE,
                &metadata,
            )
        }
        StoreError::Rule { reason, .. } => status(Code::FailedPrecondition, text, reason, &[]),
        StoreError::TooLarge { field, value } => {
            invalid(text, field.to_owned(), format!("{value} is too large"))
        }
        error @ StoreError::Unavailable { .. } => unavailable(&error),
        StoreError::Conflict { .. } => {
            tracing::warn!(error = text, "two calls changed the same thing");
            let text = "another call changed the same thing first; try again".to_owned();
            status(Code::Aborted, text, "CONFLICT", &[])
        }
        error @ (StoreError::Database { .. } | StoreError::Corrupt { .. }) => internal(&error),
    }
}

/// `text`, cut to at most `bytes` bytes with an ellipsis.
fn brief(text: &str, bytes: usize) -> String {
    match beginning(text, bytes) {
        whole if whole.len() == text.len() => whole.to_owned(),
        _ => format!("{}…", beginning(text, bytes - '…'.len_utf8())),
    }
}

fn status(
    code: Code,
    text: String,
    reason: &'static str,
    metadata: &[(&'static str, String)],
) -> Status {
    let text = brief(&text, TEXT_BYTES);
    let metadata: HashMap<String, String> = metadata
        .iter()
        .map(|(key, value)| ((*key).to_owned(), brief(value, FIELD_BYTES)))
        .collect();
    Status::with_error_details(
        code,
        text,
        ErrorDetails::with_error_info(reason, DOMAIN, metadata),
    )
}

fn invalid(text: String, field: String, message: String) -> Status {
    let (text, message) = (brief(&text, TEXT_BYTES), brief(&message, TEXT_BYTES));
    let field = brief(&field, FIELD_BYTES);
    let metadata = HashMap::from([("field".to_owned(), field.clone())]);
    let mut details = ErrorDetails::with_error_info("INVALID_ARGUMENT", DOMAIN, metadata);
    details.add_bad_request_violation(field, message);
    Status::with_error_details(Code::InvalidArgument, text, details)
}

/// An object that differs from its entry in the catalogue. Only the operator sees its key, in the log.
fn altered(error: &ObjectsError) -> Status {
    tracing::error!(%error, "a stored object is missing or altered");
    let text = "a stored object is missing or altered; see the coordinator's log".to_owned();
    status(Code::DataLoss, text, "OBJECT_ALTERED", &[])
}

/// The error when the database or the disk fails for now: the same call may succeed later.
fn unavailable(error: &dyn std::error::Error) -> Status {
    tracing::warn!(%error, "the store is unavailable for a request");
    let text = "the service can't read or write its store: it is locked, or its disk is full; \
                see the coordinator's log";
    status(Code::Unavailable, text.to_owned(), "STORE_UNAVAILABLE", &[])
}

fn internal(error: &dyn std::error::Error) -> Status {
    tracing::error!(%error, "internal error in a request");
    let text = "internal error of the coordinator; see its log".to_owned();
    status(Code::Internal, text, "INTERNAL", &[])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Maximum size of headers that gRPC's C core accepts by default.
    const HEADER_BYTES: usize = 8 << 10;

    #[test]
    fn an_error_fits_into_headers_whatever_it_quotes() {
        let number = || "1.2345678, ".repeat(5000);
        let marks = || "é".repeat(50_000);
        for error in [
            RequestError::invalid("spec.render.background", number()),
            RequestError::invalid(marks(), marks()),
            RequestError::precondition("NO_SLOT", marks()),
            RequestError::NotFound { name: marks() },
        ] {
            let response = Status::from(error).into_http::<()>();
            let headers = response.headers().iter();
            let bytes: usize = headers
                .map(|(key, value)| key.as_str().len() + value.len())
                .sum();
            assert!(bytes < HEADER_BYTES, "{bytes} bytes");
        }
        let short = Status::from(RequestError::invalid("a", "b"));
        assert_eq!(short.message(), "a: b");
    }
}
