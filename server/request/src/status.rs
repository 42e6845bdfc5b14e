//! Errors as clients see them: a gRPC code with `google.rpc` details.
//!
//! Faults of a request are reported in full. Internal errors are logged here, once, and not reported: their
//! details would help attackers, not callers.

use crate::RequestError;
use crate::validation::{FieldFault, FieldFaults};
use std::collections::HashMap;
use tonic::{Code, Status};
use tonic_types::{ErrorDetails, FieldViolation, PreconditionViolation, StatusExt};
use yoto_objects::ObjectsError;
use yoto_process::metrics::METRICS;
use yoto_proto::limits::beginning;
use yoto_proto::reasons::{DOMAIN, code};
use yoto_proto::v1::ErrorReason as Reason;
use yoto_store::StoreError;

/// Maximum length of an error's message, bytes. Errors are sent in headers, and gRPC's C core accepts 8 KiB of headers.
/// The message is sent once percent-encoded (up to 3 bytes for each) and twice in Base64 details (4 bytes for 3).
const TEXT_BYTES: usize = 1024;
/// Maximum length of a field's name, or of a metadata value of an error, bytes.
const FIELD_BYTES: usize = 256;
/// Maximum length of each text of an error with several faults, bytes.
const TEXT_OF_SEVERAL_BYTES: usize = 256;
/// Maximum length of all field names and descriptions of an error with several faults, bytes. They are sent once, in Base64,
/// with about 8 bytes of tags for each.
const SEVERAL_BYTES: usize = 2048;

impl From<RequestError> for Status {
    fn from(error: RequestError) -> Self {
        let text = error.to_string();
        match error {
            RequestError::NotFound { name } => status(Reason::NotFound, text, &[("name", name)]),
            RequestError::Invalid(faults) => invalid(&faults),
            RequestError::Several(errors) => several(errors),
            RequestError::Precondition { reason, .. } | RequestError::Refused { reason, .. } => {
                status(reason, text, &[])
            }
            RequestError::DiskFull { free, needed } => {
                let metadata = [("free", free.to_string()), ("needed", needed.to_string())];
                status(Reason::DiskFull, text, &metadata)
            }
            RequestError::CorruptChunk { .. } => status(Reason::CorruptChunk, text, &[]),
            RequestError::Busy(_) => status(Reason::Busy, text, &[]),
            // The writer has logged why.
            RequestError::NotAudited => unavailable_for_now(),
            RequestError::ShuttingDown => status(Reason::ShuttingDown, text, &[]),
            RequestError::Stream(status) => status,
            error @ RequestError::NoTenant => internal(&error),
            RequestError::Store(error) => store(error),
            RequestError::Objects(error) => objects(&error),
        }
    }
}

fn objects(error: &ObjectsError) -> Status {
    METRICS.objects_failed();
    if error.is_torn() {
        return altered(error);
    }
    let text = error.with_causes();
    if error.is_refused() {
        tracing::error!(
            error = text,
            "the object store refuses this service: its operator has to change something"
        );
        return unavailable_for_now();
    }
    if error.is_full() || error.is_unavailable() {
        tracing::warn!(
            error = text,
            "the object store is unavailable for a request"
        );
        return unavailable_for_now();
    }
    internal(&text)
}

fn store(error: StoreError) -> Status {
    let text = error.to_string();
    match error {
        StoreError::NotFound { name } => status(Reason::NotFound, text, &[("name", name)]),
        StoreError::RequestIdReused { request_id } => {
            let metadata = [("request_id", request_id)];
            status(Reason::RequestIdReused, text, &metadata)
        }
        StoreError::StaleLease { job, token } => {
            let metadata = [("job", job), ("token", token.to_string())];
            status(Reason::StaleLease, text, &metadata)
        }
        StoreError::Rule { reason, .. } => status(reason, text, &[]),
        StoreError::QuotaReached { quota, used, most } => {
            let metadata = [
                ("quota", quota.to_owned()),
                ("used", used.to_string()),
                ("most", most.to_string()),
            ];
            status(Reason::Quota, text, &metadata)
        }
        StoreError::TooLarge { field, value } => {
            let message = format!("{value} is too large");
            invalid(&FieldFaults::one(field.to_owned(), message))
        }
        error @ StoreError::Unavailable { .. } => unavailable(&error),
        StoreError::Conflict { .. } => {
            tracing::warn!(error = text, "two calls changed the same thing");
            let text = "another call changed the same thing first; try again".to_owned();
            status(Reason::Conflict, text, &[])
        }
        error @ (StoreError::Database { .. }
        | StoreError::Corrupt { .. }
        | StoreError::Unusable(_)) => internal(&error),
    }
}

/// `text`, cut to at most `bytes` bytes with an ellipsis.
fn brief(text: &str, bytes: usize) -> String {
    match beginning(text, bytes) {
        whole if whole.len() == text.len() => whole.to_owned(),
        _ => format!("{}…", beginning(text, bytes - '…'.len_utf8())),
    }
}

fn status(reason: Reason, text: String, metadata: &[(&'static str, String)]) -> Status {
    let text = brief(&text, TEXT_BYTES);
    let metadata: HashMap<String, String> = metadata
        .iter()
        .map(|(key, value)| ((*key).to_owned(), brief(value, FIELD_BYTES)))
        .collect();
    let details = ErrorDetails::with_error_info(reason.as_str_name(), DOMAIN, metadata);
    Status::with_error_details(code(reason), text, details)
}

/// The answer to a request with these faults, as far as there is room for them.
fn invalid(faults: &FieldFaults) -> Status {
    let longest = match faults.count {
        1 => TEXT_BYTES,
        _ => TEXT_OF_SEVERAL_BYTES,
    };
    let mut named = Vec::new();
    let mut bytes = 0;
    for FieldFault { field, message } in &faults.kept {
        let (field, message) = (brief(field, FIELD_BYTES), brief(message, longest));
        bytes += field.len() + message.len() + 8;
        if bytes > SEVERAL_BYTES {
            break;
        }
        named.push(FieldViolation::new(field, message));
    }
    let field = named
        .first()
        .map_or_else(String::new, |it| it.field.clone());
    let mut text = match faults.kept.first() {
        Some(fault) => brief(&told(fault), longest),
        None => String::new(),
    };
    // A client shows the further faults that are named, and this the others.
    match (faults.count - named.len().min(faults.count), named.len()) {
        (0, 0 | 1) => {}
        (0, all) => text.push_str(&format!("; {all} faults in all")),
        (more, _) => text.push_str(&format!(
            "; {} faults in all, of which {more} are not named",
            faults.count
        )),
    }
    let metadata = HashMap::from([("field".to_owned(), field)]);
    let reason = Reason::InvalidArgument;
    let mut details = ErrorDetails::with_error_info(reason.as_str_name(), DOMAIN, metadata);
    details.set_bad_request(named);
    Status::with_error_details(code(reason), text, details)
}

/// The number of faults that an error is about.
fn count(error: &RequestError) -> usize {
    match error {
        RequestError::Invalid(faults) => faults.count,
        _ => 1,
    }
}

fn told(FieldFault { field, message }: &FieldFault) -> String {
    format!("{field}: {message}")
}

/// The answer to a request with faults of several kinds, as far as there is room for them: the code and the reason are the
/// first one's. Faults of fields are named in a `BadRequest`, and all others in a `PreconditionFailure`, each with its reason.
fn several(errors: Vec<RequestError>) -> Status {
    let count: usize = errors.iter().map(count).sum();
    let text = match errors.first() {
        Some(RequestError::Invalid(faults)) => faults.kept.first().map_or_else(String::new, told),
        first => first.map_or_else(String::new, ToString::to_string),
    };
    let text = format!(
        "{}; {count} faults in all",
        brief(&text, TEXT_OF_SEVERAL_BYTES)
    );
    let statuses: Vec<Status> = errors.into_iter().map(Status::from).collect();
    // The two lists together have the room of one.
    let mut room = SEVERAL_BYTES;
    let mut fits = |name: &str, message: &str| {
        let left = room.checked_sub(name.len() + message.len() + 8);
        room = left.unwrap_or(room);
        left.is_some()
    };
    let (mut fields, mut others) = (Vec::new(), Vec::new());
    for status in &statuses {
        let details = status.get_error_details();
        let reason = details.error_info().map_or("", |it| it.reason.as_str());
        let message = brief(status.message(), TEXT_OF_SEVERAL_BYTES);
        match details.bad_request() {
            Some(bad) => fields.extend(bad.field_violations.iter().cloned()),
            None if fits(reason, &message) => {
                others.push(PreconditionViolation::new(reason, "", message));
            }
            None => {}
        }
    }
    fields.retain(|it: &FieldViolation| fits(&it.field, &it.description));
    let first = statuses.first();
    let code = first.map_or(Code::InvalidArgument, Status::code);
    let info = first.and_then(|it| it.get_error_details().error_info().cloned());
    let reason = info.map_or_else(String::new, |it| it.reason);
    let mut details = ErrorDetails::with_error_info(reason, DOMAIN, HashMap::new());
    details.set_bad_request(fields);
    details.set_precondition_failure(others);
    Status::with_error_details(code, text, details)
}

/// An object that differs from its entry in the catalogue. Only the operator sees its key, in the log.
fn altered(error: &ObjectsError) -> Status {
    tracing::error!(%error, "a stored object is missing or altered");
    let text = "a stored object is missing or altered; see the coordinator's log".to_owned();
    status(Reason::ObjectAltered, text, &[])
}

/// The error when the database fails for now: the same call may succeed later.
fn unavailable(error: &StoreError) -> Status {
    tracing::warn!(%error, "the store is unavailable for a request");
    unavailable_for_now()
}

/// Nothing that a client does ends it; it waits.
fn unavailable_for_now() -> Status {
    let text = "the service can't read or write its store: it is locked, full, or does not answer; \
                see the coordinator's log";
    status(Reason::StoreUnavailable, text.to_owned(), &[])
}

fn internal(error: &impl std::fmt::Display) -> Status {
    tracing::error!(%error, "internal error in a request");
    let text = "internal error of the coordinator; see its log".to_owned();
    status(Reason::Internal, text, &[])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::validation::all;

    /// Maximum size of headers that gRPC's C core accepts by default.
    const HEADER_BYTES: usize = 8 << 10;

    #[test]
    fn an_error_fits_into_headers_whatever_it_quotes() {
        let number = || "1.2345678, ".repeat(5000);
        let marks = || "é".repeat(50_000);
        for error in [
            RequestError::invalid("spec.render.background", number()),
            RequestError::invalid(marks(), marks()),
            RequestError::precondition(Reason::NoSlot, marks()),
            RequestError::NotFound { name: marks() },
            all::<()>((0..200).map(|_| Err(RequestError::invalid(marks(), marks()))))
                .expect_err("is refused"),
            all::<()>((0..400).map(|number| {
                let text = format!("{number}{}", marks());
                Err(match number % 2 {
                    0 => RequestError::invalid(marks(), text),
                    _ => RequestError::precondition(Reason::NoSlot, text),
                })
            }))
            .expect_err("is refused"),
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

    #[test]
    fn all_faults_are_named_as_far_as_there_is_room() {
        let told = |count: usize| {
            let bad = |index| Err(RequestError::invalid(format!("a[{index}]"), "is bad"));
            let refused = all::<()>((0..count).map(bad)).expect_err("is refused");
            let status = Status::from(refused);
            let details = status.get_error_details();
            let bad = details.bad_request().map(|it| it.field_violations.len());
            (status.message().to_owned(), bad.unwrap_or_default())
        };
        assert_eq!(told(1), ("a[0]: is bad".into(), 1));
        assert_eq!(told(3), ("a[0]: is bad; 3 faults in all".into(), 3));
        let (text, named) = told(1000);
        assert!((50..=100).contains(&named), "{named}");
        let more = 1000 - named;
        assert_eq!(
            text,
            format!("a[0]: is bad; 1000 faults in all, of which {more} are not named")
        );
    }
}
