//! Answers that are streams: server-sent events for browsers, or one JSON object per line.

use super::bindings::Binding;
use super::call::Answers;
use super::{json, problem};
use axum::body::Body;
use axum::http::header::{ACCEPT, CACHE_CONTROL, CONTENT_TYPE};
use axum::http::{HeaderMap, HeaderValue, Response};
use futures::{Stream, StreamExt, stream};
use prost_reflect::DynamicMessage;
use std::convert::Infallible;
use std::time::Duration;
use tokio::time::{Instant, Interval, MissedTickBehavior, interval_at};
use tonic::Status;

const EVENTS: &str = "text/event-stream";
const LINES: &str = "application/x-ndjson";
/// Interval of comments that keep a silent stream of events open.
const TICK: Duration = Duration::from_secs(15);
/// The header with the id of the last event that a browser has seen.
pub const LAST_EVENT: &str = "last-event-id";
/// The field that a new watch takes it for.
pub const AFTER: &str = "after_sequence";

/// Answers with all messages, in the form that `headers` accept. An error before the first one is the answer itself.
pub async fn answer(
    binding: &'static Binding,
    mut answers: Answers,
    headers: &HeaderMap,
) -> Response<Body> {
    let first = match answers.next().await {
        Ok(first) => first,
        Err(status) => return problem::answer(&status),
    };
    let messages = stream::iter(first.map(Ok)).chain(answers.stream());
    let messages = messages.map(|message| json::read(binding.method.output(), &message?));
    let accepted = headers.get(ACCEPT).and_then(|it| it.to_str().ok());
    let (kind, body) = match accepted.is_some_and(|it| it.contains(EVENTS)) {
        true => (EVENTS, Body::from_stream(events(messages))),
        false => (LINES, Body::from_stream(messages.map(|it| line(&it)))),
    };
    let mut answer = Response::new(body);
    let headers = answer.headers_mut();
    headers.insert(CONTENT_TYPE, HeaderValue::from_static(kind));
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    answer
}

type Line = Result<String, Infallible>;

/// A message in a line, or the error that ends the stream.
fn line(message: &Result<DynamicMessage, Status>) -> Line {
    let mut line = match message {
        Ok(message) => json::text(message),
        Err(status) => json::error(status),
    };
    line.push('\n');
    Ok(line)
}

/// Messages as events, with comments between them.
fn events(
    messages: impl Stream<Item = Result<DynamicMessage, Status>> + Send + 'static,
) -> impl Stream<Item = Line> + Send {
    let mut ticks = interval_at(Instant::now() + TICK, TICK);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let state = (messages.boxed(), ticks);
    stream::unfold(state, |(mut messages, mut ticks): (_, Interval)| async {
        let event = tokio::select! {
            biased;
            message = messages.next() => event(&message?),
            _ = ticks.tick() => ":\n\n".to_owned(),
        };
        Some((Ok(event), (messages, ticks)))
    })
}

/// A message as an event. Its id is the sequence number of its job, from which a new watch goes on.
fn event(message: &Result<DynamicMessage, Status>) -> String {
    match message {
        Ok(message) => {
            let id = sequence(message).map_or_else(String::new, |it| format!("id: {it}\n"));
            format!("{id}data: {}\n\n", json::text(message))
        }
        // Not `error`: browsers call the loss of a connection so, and connect again.
        Err(status) => format!("event: problem\ndata: {}\n\n", json::error(status)),
    }
}

fn sequence(message: &DynamicMessage) -> Option<u64> {
    let job = message.get_field_by_name("job")?;
    let sequence = job.as_message()?.get_field_by_name("sequence")?;
    sequence.as_u64()
}

#[cfg(test)]
mod tests {
    use super::*;
    use prost::Message;
    use yoto_proto::v1::{Job, WatchJobResponse};
    use yoto_request::methods::POOL;

    #[test]
    fn an_event_has_the_sequence_number_as_its_id() {
        let job = Job {
            name: "jobs/a\nb".to_owned(),
            sequence: 7,
            ..Job::default()
        };
        let response = WatchJobResponse { job: Some(job) }.encode_to_vec();
        let kind = POOL.get_message_by_name("yoto.v1.WatchJobResponse");
        let message = json::read(kind.expect("it is of the contract"), &response);
        let event = event(&message);
        assert!(event.starts_with("id: 7\ndata: {"), "{event}");
        assert_eq!(event.matches('\n').count(), 3, "{event}");
        let end = super::event(&Err(Status::unavailable("later")));
        assert!(end.starts_with("event: problem\ndata: {"), "{end}");
    }
}
