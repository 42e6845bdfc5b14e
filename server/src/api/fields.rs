//! Checks of single request fields.

use crate::jobs::queue;
use prost::Message;
use prost_types::Timestamp;
use yoto_proto::limits::{DISPLAY_NAME_BYTES, OWNER_CHARACTERS, REQUEST_ID_BYTES};
use yoto_proto::names::Collection;
use yoto_proto::text::is_hidden;
use yoto_proto::v1::{JobPriority, JobSpec};
use yoto_request::validation::{all, both};
use yoto_request::{Caller, RequestError};
use yoto_store::{JobKind, NewJob, OperatorNote, RequestKey};

/// What an operator says by this call.
pub(super) fn note<'a>(reason: &'a str, caller: &'a Caller) -> OperatorNote<'a> {
    OperatorNote {
        reason,
        key: caller.key().unwrap_or_default(),
    }
}

/// The id in a resource name.
pub(crate) fn id(collection: Collection, field: &str, name: &str) -> Result<String, RequestError> {
    let id = collection.parse(name);
    id.map(str::to_owned)
        .map_err(|error| RequestError::invalid(field, error.to_string()))
}

/// A display name: one line, not empty, without the comma that separates names in lists.
pub(crate) fn display_name(name: &str) -> Result<String, RequestError> {
    let name = name.trim();
    if name.is_empty() || name.len() > DISPLAY_NAME_BYTES || name.chars().any(is_hidden) {
        let message = format!("a display name is one line of 1 to {DISPLAY_NAME_BYTES} bytes");
        return Err(RequestError::invalid("display_name", message));
    }
    if name.contains(',') {
        let message = format!("'{name}' has a comma, which separates names in lists");
        return Err(RequestError::invalid("display_name", message));
    }
    Ok(name.to_owned())
}

/// A line for people, which may be empty.
pub(crate) fn line(field: &str, text: &str, longest: usize) -> Result<String, RequestError> {
    let text = text.trim();
    if text.chars().count() > longest || text.chars().any(is_hidden) {
        let message = format!("one line of at most {longest} characters is allowed");
        return Err(RequestError::invalid(field, message));
    }
    Ok(text.to_owned())
}

/// Checks a text of several lines for people, which may be empty.
pub(crate) fn lines(field: &str, text: &str, longest: usize) -> Result<(), RequestError> {
    let hidden = |it: char| is_hidden(it) && !matches!(it, '\n' | '\r' | '\t');
    if text.len() > longest || text.chars().any(hidden) {
        let message = format!("at most {longest} bytes of printable text are allowed");
        return Err(RequestError::invalid(field, message));
    }
    Ok(())
}

/// The last second that JSON can tell, that of 9999-12-31.
const LAST: i64 = 253_402_300_799;

/// The time at which something ends, seconds since 1970: within the calendar, and after `now` if given.
pub(crate) fn end(
    field: &str,
    time: Option<&Timestamp>,
    now: Option<f64>,
) -> Result<Option<f64>, RequestError> {
    let Some(Timestamp { seconds, nanos }) = time else {
        return Ok(None);
    };
    let refused = |message: String| Err(RequestError::invalid(field, message));
    if !(0..=LAST).contains(seconds) || !(0..1_000_000_000).contains(nanos) {
        return refused(format!(
            "{seconds} seconds and {nanos} nanoseconds since 1970 are not a time of the years 1970 to 9999"
        ));
    }
    let end = *seconds as f64 + f64::from(*nanos) * 1e-9;
    match now {
        Some(now) if end <= now => refused("the time is over already".to_owned()),
        _ => Ok(Some(end)),
    }
}

/// Kinds of jobs. An unknown kind is refused: it would match no job.
pub(crate) fn job_kinds(field: &str, numbers: &[i32]) -> Result<Vec<JobKind>, RequestError> {
    let known = |number: &i32| job_kind(field, *number);
    let mut kinds = all(numbers.iter().map(known))?;
    // Each is a parameter of a statement, of which databases take a limited number.
    kinds.sort_unstable();
    kinds.dedup();
    Ok(kinds)
}

/// A kind of jobs.
pub(crate) fn job_kind(field: &str, number: i32) -> Result<JobKind, RequestError> {
    JobKind::of_proto(number)
        .ok_or_else(|| RequestError::invalid(field, format!("{number} is not a kind of job")))
}

/// An order as a call gives it, which is well-formed.
pub(crate) fn new_job(spec: JobSpec, priority: i32, owner: &str) -> Result<NewJob, RequestError> {
    let of_queue = both(column(priority), line("owner", owner, OWNER_CHARACTERS));
    let ((priority, owner), ()) = both(of_queue, queue::check_order(&spec))?;
    Ok(NewJob {
        spec,
        priority,
        owner,
        trace_parent: None,
    })
}

/// The column of the priority with this number.
fn column(priority: i32) -> Result<u8, RequestError> {
    let unknown = || RequestError::invalid("priority", format!("{priority} is not a priority"));
    let known = JobPriority::try_from(priority).map_err(|_| unknown())?;
    Ok(NewJob::column(known))
}

/// A request id: printable, and not too long.
pub(crate) fn request_id(request_id: &str) -> Result<(), RequestError> {
    if request_id.len() > REQUEST_ID_BYTES || request_id.chars().any(is_hidden) {
        let message = format!("a request id has at most {REQUEST_ID_BYTES} printable bytes");
        return Err(RequestError::invalid("request_id", message));
    }
    Ok(())
}

/// The key of a repeatable request.
pub(crate) fn request_key(
    method: &'static str,
    id: &str,
    body: &impl Message,
) -> Result<Option<RequestKey>, RequestError> {
    request_id(id)?;
    Ok(RequestKey::new(method, id, body))
}
