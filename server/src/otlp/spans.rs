//! The trace of an ended job: its time in the queue and its attempts.
//!
//! Ids follow from the job's name: a second send replaces the first. The trace's id is the first 16 bytes of the name's SHA-256, so
//! that a trace can be found by its job's name, unless the caller had a trace, which the job then belongs to.

use super::attributes::{number, text};
use opentelemetry_proto::tonic::common::v1::KeyValue;
use opentelemetry_proto::tonic::trace::v1::span::SpanKind;
use opentelemetry_proto::tonic::trace::v1::status::StatusCode;
use opentelemetry_proto::tonic::trace::v1::{Span, Status};
use prost_types::Timestamp;
use sha2::{Digest, Sha256};
use yoto_proto::v1::job_attempt::Outcome;
use yoto_proto::v1::{Job, JobAttempt, JobError, job};
use yoto_store::{EndedJob, JobKind};

/// The span of a job, its time in the queue, and each recorded attempt.
pub(super) fn of(ended: &EndedJob) -> Vec<Span> {
    let job = &ended.job;
    let end = nanos(job.end_time);
    let mut spans = vec![root(ended, end), queued(job, end)];
    let attempts = job.attempts.iter().map(|it| attempt(job, it, end));
    spans.extend(attempts);
    if let Some(parent) = ended.trace_parent {
        for span in &mut spans {
            span.trace_id = parent.trace.to_vec();
        }
    }
    spans
}

fn root(ended: &EndedJob, end: u64) -> Span {
    let job = &ended.job;
    let kind = JobKind::of_proto(job.kind).map_or("job", JobKind::as_str);
    let mut attributes = vec![
        text("yoto.job", &job.name),
        text("yoto.kind", kind),
        text("yoto.tenant", &ended.tenant),
        text("yoto.outcome", job.state().as_str_name()),
        number("yoto.lost_workers", job.lost_workers.into()),
    ];
    let named = [
        ("yoto.request_id", ended.request_id.as_deref()),
        ("yoto.model", Some(job.model.as_str())),
        ("yoto.capture", Some(job.capture.as_str())),
        ("yoto.owner", Some(job.owner.as_str())),
    ];
    for (key, value) in named {
        attributes.extend(value.filter(|it| !it.is_empty()).map(|it| text(key, it)));
    }
    let failed = job.state() == job::State::Failed;
    let parent = ended.trace_parent.map(|it| it.span.to_vec());
    Span {
        span_id: root_id(job),
        parent_span_id: parent.unwrap_or_default(),
        name: kind.to_owned(),
        ..span(
            job,
            (nanos(job.create_time), end),
            attributes,
            failed.then(|| code(job.error.as_ref())),
        )
    }
}

/// From the order to the first lease, or to the end of a job without one.
fn queued(job: &Job, end: u64) -> Span {
    let until = job.start_time.map_or(end, |it| nanos(Some(it)));
    Span {
        span_id: span_id(job, "queued"),
        name: "queued".to_owned(),
        ..span(job, (nanos(job.create_time), until), Vec::new(), None)
    }
}

fn attempt(job: &Job, attempt: &JobAttempt, end: u64) -> Span {
    let outcome = attempt.outcome();
    let attributes = vec![
        number("yoto.attempt", attempt.number),
        text("yoto.worker", &attempt.worker),
        text("yoto.worker_name", &attempt.worker_display_name),
        text("yoto.outcome", outcome.as_str_name()),
    ];
    let error = match outcome {
        Outcome::Failed | Outcome::Postponed => Some(code(attempt.error.as_ref())),
        Outcome::Lost => Some("WORKER_LOST".to_owned()),
        _ => None,
    };
    let until = attempt.end_time.map_or(end, |it| nanos(Some(it)));
    Span {
        span_id: span_id(job, &format!("attempt/{}", attempt.number)),
        name: "attempt".to_owned(),
        ..span(job, (nanos(attempt.begin_time), until), attributes, error)
    }
}

/// A child of the root. An `error` is the code of what failed.
fn span(
    job: &Job,
    (start, end): (u64, u64),
    mut attributes: Vec<KeyValue>,
    error: Option<String>,
) -> Span {
    attributes.extend(error.as_ref().map(|code| text("error.type", code)));
    Span {
        trace_id: digest(&job.name)[..16].to_vec(),
        parent_span_id: root_id(job),
        kind: SpanKind::Internal.into(),
        start_time_unix_nano: start,
        // The clock may have been set back.
        end_time_unix_nano: end.max(start),
        attributes,
        status: error.map(|message| Status {
            message,
            code: StatusCode::Error.into(),
        }),
        ..Span::default()
    }
}

fn code(error: Option<&JobError>) -> String {
    error.map(|it| it.code.clone()).unwrap_or_default()
}

fn root_id(job: &Job) -> Vec<u8> {
    span_id(job, "job")
}

/// The id of the job's span called `which`.
fn span_id(job: &Job, which: &str) -> Vec<u8> {
    digest(&format!("{}/{which}", job.name))[..8].to_vec()
}

fn digest(text: &str) -> [u8; 32] {
    Sha256::digest(text.as_bytes()).into()
}

/// Nanoseconds since 1970; 0 without a time, or before.
fn nanos(time: Option<Timestamp>) -> u64 {
    let time = time.unwrap_or_default();
    let seconds = u64::try_from(time.seconds).unwrap_or(0);
    let within = u64::try_from(time.nanos).unwrap_or(0);
    seconds.saturating_mul(1_000_000_000).saturating_add(within)
}
