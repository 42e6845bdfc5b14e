//! The resources that a call of gRPC names, and the one that it made.

use axum::body::{Body, Bytes};
use axum::extract::Request;
use axum::response::Response;
use http_body_util::BodyExt;
use prost_reflect::{DynamicMessage, Value};
use std::collections::BTreeSet;
use yoto_proto::names::is_name;
use yoto_request::methods::POOL;
use yoto_store::Tenant;

/// Longest message that is read for its names. That of an order with all poses of a motion is longer, and has no others.
const READ_BYTES: usize = 64 << 10;
/// Most names of an entry.
const MOST: usize = 16;
/// Before a message: whether it is compressed, and its length.
const PREFIX: usize = 5;

/// The names in the message of a unary call, with spaces between them, and the call as it was. Texts that are not names of
/// resources are left out: they may name people.
pub(super) async fn of(request: Request, message: &str) -> (Request, String) {
    let (head, body) = request.into_parts();
    let (read, body) = beginning(body).await;
    let mut names = BTreeSet::new();
    if let Some(message) = decoded(message, &read) {
        collect(&message, &mut names);
    }
    let names: Vec<String> = names.into_iter().take(MOST).collect();
    (Request::from_parts(head, body), names.join(" "))
}

/// The name of the resource in the answer of a unary call, and the answer as it was. It is the answer itself, or a message in it;
/// empty if there is none.
pub(super) async fn of_answer(answer: Response, message: &str) -> (Response, String) {
    let (head, body) = answer.into_parts();
    let (read, body) = beginning(body).await;
    let name = decoded(message, &read).and_then(|it| {
        let inner = it.fields().filter_map(|(_, value)| value.as_message());
        own_name(&it).or_else(|| inner.into_iter().find_map(own_name))
    });
    (Response::from_parts(head, body), name.unwrap_or_default())
}

fn own_name(message: &DynamicMessage) -> Option<String> {
    let name = message.get_field_by_name("name")?;
    let name = name.as_str().filter(|it| is_name(it))?;
    Some(name.to_owned())
}

/// The body's first bytes, and the whole body.
async fn beginning(mut body: Body) -> (Vec<u8>, Body) {
    let mut frames = Vec::new();
    let mut read = Vec::new();
    while read.len() < wanted(&read) {
        let Some(Ok(frame)) = body.frame().await else {
            break;
        };
        if let Some(bytes) = frame.data_ref() {
            read.extend_from_slice(bytes);
        }
        frames.push(Ok::<_, axum::Error>(frame));
    }
    let rest = http_body_util::BodyStream::new(body);
    let frames = futures::StreamExt::chain(futures::stream::iter(frames), rest);
    (read, Body::new(http_body_util::StreamBody::new(frames)))
}

/// How many bytes to read, as far as `read` tells: the message, unless it is long.
fn wanted(read: &[u8]) -> usize {
    let Some(length) = length(read) else {
        return PREFIX;
    };
    match PREFIX.saturating_add(length) {
        whole if whole <= READ_BYTES => whole,
        _ => 0,
    }
}

fn length(read: &[u8]) -> Option<usize> {
    let bytes: [u8; 4] = read.get(1..PREFIX)?.try_into().ok()?;
    usize::try_from(u32::from_be_bytes(bytes)).ok()
}

/// The message called `kind` behind its prefix, if it is whole and not compressed.
fn decoded(kind: &str, read: &[u8]) -> Option<DynamicMessage> {
    let kind = POOL.get_message_by_name(kind.trim_start_matches('.'))?;
    let whole = read.get(PREFIX..PREFIX.checked_add(length(read)?)?)?;
    if read[0] != 0 {
        return None;
    }
    DynamicMessage::decode(kind, Bytes::copy_from_slice(whole)).ok()
}

fn collect(message: &DynamicMessage, names: &mut BTreeSet<String>) {
    for (field, value) in message.fields() {
        // A tenant has no resource of its own. What can't be the id of one is a text of the caller.
        match (field.name(), value.as_str().and_then(Tenant::new)) {
            ("tenant", Some(tenant)) => {
                names.insert(format!("tenants/{tenant}"));
            }
            _ => of_value(value, names),
        }
    }
}

fn of_value(value: &Value, names: &mut BTreeSet<String>) {
    match value {
        Value::String(text) if is_name(text) => {
            names.insert(text.clone());
        }
        Value::Message(message) => collect(message, names),
        Value::List(values) => values.iter().for_each(|it| of_value(it, names)),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use prost::Message;
    use yoto_proto::v1::{
        CreateJobRequest, CreateKeyResponse, JobSpec, Key, RenderSpec, SetQuotaRequest, job_spec,
    };

    fn framed(message: &impl Message) -> Vec<u8> {
        let bytes = message.encode_to_vec();
        let mut frame = vec![0];
        frame.extend(u32::try_from(bytes.len()).expect("short").to_be_bytes());
        frame.extend(bytes);
        frame
    }

    /// In frames of 7 bytes, as a network may bring it.
    async fn named(bytes: &[u8], message: &str) -> (String, Vec<u8>) {
        let pieces: Vec<_> = bytes.chunks(7).map(Bytes::copy_from_slice).collect();
        let pieces = futures::stream::iter(pieces.into_iter().map(Ok::<_, axum::Error>));
        let request = Request::new(Body::from_stream(pieces));
        let (request, names) = of(request, message).await;
        let whole = request.into_body().collect().await.expect("a body");
        (names, whole.to_bytes().to_vec())
    }

    fn order(display: &str) -> CreateJobRequest {
        let render = RenderSpec {
            model: "models/m1".into(),
            subject: "subjects/s1".into(),
            ..RenderSpec::default()
        };
        CreateJobRequest {
            spec: Some(JobSpec {
                kind: Some(job_spec::Kind::Render(render)),
            }),
            owner: display.into(),
            ..CreateJobRequest::default()
        }
    }

    const MESSAGE: &str = ".yoto.v1.CreateJobRequest";

    #[tokio::test]
    async fn names_are_found_and_the_call_stays_as_it_was() {
        let bytes = framed(&order("Ada Lovelace"));
        let (names, whole) = named(&bytes, MESSAGE).await;
        assert_eq!(names, "models/m1 subjects/s1");
        assert_eq!(whole, bytes);
    }

    #[tokio::test]
    async fn the_tenant_of_a_request_is_named() {
        let ask = |tenant: &str| SetQuotaRequest {
            tenant: tenant.into(),
            ..SetQuotaRequest::default()
        };
        let (names, _) = named(&framed(&ask("lab")), ".yoto.v1.SetQuotaRequest").await;
        assert_eq!(names, "tenants/lab");
        let (names, _) = named(&framed(&ask("Ada Lovelace")), ".yoto.v1.SetQuotaRequest").await;
        assert_eq!(names, "");
    }

    #[tokio::test]
    async fn the_answer_names_what_was_made() {
        let key = CreateKeyResponse {
            key: Some(Key {
                name: "keys/k1".into(),
                display_name: "Ada".into(),
                ..Key::default()
            }),
            secret: "yoto_secret".into(),
        };
        let bytes = framed(&key);
        let answer = Response::new(Body::from(bytes.clone()));
        let (answer, name) = of_answer(answer, ".yoto.v1.CreateKeyResponse").await;
        assert_eq!(name, "keys/k1");
        let whole = answer.into_body().collect().await.expect("a body");
        assert_eq!(whole.to_bytes(), bytes);
    }

    #[tokio::test]
    async fn what_is_no_short_message_has_no_names_and_stays_too() {
        let long = framed(&order(&"x".repeat(READ_BYTES)));
        let compressed = [1, 0, 0, 0, 1, 7];
        let cut = &framed(&order("Ada"))[..12];
        for bytes in [
            &long[..],
            &compressed,
            cut,
            &[],
            &[0, 255, 255, 255, 255, 1],
        ] {
            let (names, whole) = named(bytes, MESSAGE).await;
            assert_eq!(names, "");
            assert_eq!(whole, bytes);
        }
        let (names, _) = named(&framed(&order("Ada")), ".yoto.v1.Nothing").await;
        assert_eq!(names, "");
    }
}
