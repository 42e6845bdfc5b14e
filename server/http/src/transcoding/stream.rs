//! Answers that are streams: server-sent events for browsers, or one JSON object per line.

use super::bindings::Binding;
use super::call::Answers;
use super::{json, problem};
use axum::body::Body;
use axum::http::header::{ACCEPT, CACHE_CONTROL, CONTENT_TYPE};
use axum::http::{HeaderMap, Response};
use axum::response::IntoResponse;
use axum::response::sse::{Event, KeepAlive, Sse};
use futures::{Stream, StreamExt, stream};
use prost_reflect::DynamicMessage;
use std::convert::Infallible;
use std::time::Duration;
use tonic::Status;

const EVENTS: &str = "text/event-stream";
const LINES: &str = "application/x-ndjson";
const NO_STORE: &str = "no-store";
/// Silence after which a comment keeps a stream of events open.
const TICK: Duration = Duration::from_secs(15);
/// The header with the id of the last event that a browser has seen.
pub(super) const LAST_EVENT: &str = "last-event-id";
/// The field that a new watch takes it for.
pub(super) const AFTER: &str = "after_sequence";

/// Answers with all messages, in the form that `headers` accept. An error before the first one is the answer itself.
pub(super) async fn answer(
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
    if accepted.is_some_and(|it| it.contains(EVENTS)) {
        return ([(CACHE_CONTROL, NO_STORE)], events(messages)).into_response();
    }
    let lines = Body::from_stream(messages.map(|it| line(&it)));
    let headers = [(CONTENT_TYPE, LINES), (CACHE_CONTROL, NO_STORE)];
    (headers, lines).into_response()
}

/// A message as JSON.
fn text(message: &Result<DynamicMessage, Status>) -> Result<String, Status> {
    message.as_ref().map_err(Clone::clone).and_then(json::text)
}

/// A message in a line, or the error that ends the stream.
fn line(message: &Result<DynamicMessage, Status>) -> Result<String, Infallible> {
    let mut line = match text(message) {
        Ok(text) => text,
        Err(status) => json::error(&status),
    };
    line.push('\n');
    Ok(line)
}

/// Messages as events, with comments in the silence between them.
fn events(
    messages: impl Stream<Item = Result<DynamicMessage, Status>> + Send + 'static,
) -> impl IntoResponse {
    let events = messages.map(|it| Ok::<_, Infallible>(event(&it)));
    Sse::new(events).keep_alive(KeepAlive::new().interval(TICK))
}

/// A message as an event. Its id is the sequence number of its job, from which a new watch goes on.
fn event(message: &Result<DynamicMessage, Status>) -> Event {
    let event = Event::default();
    match text(message) {
        Ok(text) => {
            let number = message.as_ref().ok().and_then(sequence);
            let event = match number {
                Some(number) => event.id(number.to_string()),
                None => event,
            };
            event.data(text)
        }
        // Not `error`: browsers call the loss of a connection so, and connect again.
        Err(status) => event.event("problem").data(json::error(&status)),
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
    use axum::body::to_bytes;
    use prost::Message;
    use yoto_proto::v1::{Job, WatchJobResponse};
    use yoto_request::methods::POOL;

    /// The bytes of the stream of one message.
    async fn sent(message: Result<DynamicMessage, Status>) -> String {
        let answer = events(stream::iter([message])).into_response();
        let bytes = to_bytes(answer.into_body(), usize::MAX).await;
        String::from_utf8(bytes.expect("ends").to_vec()).expect("UTF-8")
    }

    #[tokio::test]
    async fn an_event_has_the_sequence_number_as_its_id() {
        let job = Job {
            name: "jobs/a\nb".to_owned(),
            sequence: 7,
            ..Job::default()
        };
        let response = WatchJobResponse { job: Some(job) }.encode_to_vec();
        let kind = POOL.get_message_by_name("yoto.v1.WatchJobResponse");
        let message = json::read(kind.expect("it is of the contract"), &response);
        let event = sent(message).await;
        assert!(event.starts_with("id: 7\ndata: {"), "{event}");
        assert_eq!(event.matches('\n').count(), 3, "{event}");
        // What JSON can not tell is an error, not a text in its place.
        let job = Job {
            create_time: Some(prost_reflect::prost_types::Timestamp {
                seconds: 1 << 60,
                nanos: 0,
            }),
            ..Job::default()
        };
        let response = WatchJobResponse { job: Some(job) }.encode_to_vec();
        let kind = POOL.get_message_by_name("yoto.v1.WatchJobResponse");
        let beyond = sent(json::read(kind.expect("it is of the contract"), &response)).await;
        assert!(beyond.starts_with("event: problem\ndata: {"), "{beyond}");
        let end = sent(Err(Status::unavailable("later"))).await;
        assert!(end.starts_with("event: problem\ndata: {"), "{end}");
        assert!(end.ends_with("}\n\n"), "{end}");
    }
}
