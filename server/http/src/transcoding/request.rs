//! The request of a call, out of path, query and body of an HTTP request.

use super::bindings::{BodyOf, BoundCall, empty};
use super::unique::Unique;
use prost_reflect::{DeserializeOptions, DynamicMessage, FieldDescriptor, Kind, MessageDescriptor};
use serde_json::{Map, Value};
use yoto_request::RequestError;

/// Longest body, bytes. Its message takes many times that while it is read, so it is shorter than a message of gRPC.
pub(super) const LONGEST: usize = 4 << 20;
/// Most parts of a body, each of which takes some hundred bytes while it is read.
const MOST_PARTS: usize = 500_000;
/// The field that makes a repeated request one.
const REQUEST_ID: &str = "request_id";

/// What of an HTTP request becomes fields, beside the path.
#[derive(Debug, Default)]
pub(super) struct HttpInput<'a> {
    /// The query without its question mark.
    pub query: &'a str,
    /// The body.
    pub body: &'a [u8],
    /// The header `Idempotency-Key`.
    pub idempotency_key: Option<&'a str>,
}

/// The request.
///
/// # Errors
/// When a field is unknown, or has no value of its type. The error names it.
pub(super) fn message(
    found: &BoundCall,
    sent: &HttpInput<'_>,
) -> Result<DynamicMessage, RequestError> {
    let binding = found.binding;
    let kind = binding.method.input();
    let mut fields = match &binding.body {
        BodyOf::Nothing if sent.body.is_empty() => Map::new(),
        BodyOf::Nothing => {
            let message = format!(
                "{} takes no body: its fields are in the query",
                binding.verb
            );
            return Err(RequestError::invalid("body", message));
        }
        BodyOf::Message => object(sent.body)?,
        BodyOf::Field(field) => {
            let value = Value::Object(object(sent.body)?);
            Map::from_iter([(field.clone(), value)])
        }
    };
    for (name, value) in url::form_urlencoded::parse(sent.query.as_bytes()) {
        let field = leaf(&kind, &name)?;
        let value = scalar(&field, &name, &value)?;
        set(&mut fields, &kind, &name, value, field.is_list())?;
    }
    for (path, value) in &found.values {
        set(
            &mut fields,
            &kind,
            path,
            Value::String(value.clone()),
            false,
        )?;
    }
    if let Some(key) = sent.idempotency_key
        && kind.get_field_by_name(REQUEST_ID).is_some()
        && known(&fields, &kind, REQUEST_ID).is_none()
    {
        fields.insert(REQUEST_ID.to_owned(), key.into());
    }
    if fields.is_empty() {
        return Ok(empty(&binding.method));
    }
    let options = DeserializeOptions::new().deny_unknown_fields(true);
    DynamicMessage::deserialize_with_options(kind, Value::Object(fields), &options)
        .map_err(|error| RequestError::invalid("body", error.to_string()))
}

/// The object that a body is; an empty body is an empty object.
fn object(body: &[u8]) -> Result<Map<String, Value>, RequestError> {
    let refused = |message: String| Err(RequestError::invalid("body", message));
    if body.is_empty() {
        return Ok(Map::new());
    }
    let parts = body.iter().filter(|it| matches!(it, b',' | b'{' | b'['));
    if parts.count() > MOST_PARTS {
        return refused(format!("it has more than {MOST_PARTS} parts"));
    }
    match serde_json::from_slice(body) {
        Ok(Unique(Value::Object(fields))) => Ok(fields),
        Ok(_) => refused("it is not a JSON object".to_owned()),
        Err(error) => refused(format!("it is not JSON: {error}")),
    }
}

/// The field at the path `name`, such as `view` or `spec.train.steps`.
fn leaf(kind: &MessageDescriptor, name: &str) -> Result<FieldDescriptor, RequestError> {
    let unknown = || RequestError::invalid(name, "there is no such field");
    let (first, rest) = name.split_once('.').unwrap_or((name, ""));
    let field = of_name(kind, first).ok_or_else(unknown)?;
    if rest.is_empty() {
        return Ok(field);
    }
    match field.kind() {
        Kind::Message(inner) if !field.is_list() && !field.is_map() => {
            leaf(&inner, rest).map_err(|_| unknown())
        }
        _ => Err(unknown()),
    }
}

fn of_name(kind: &MessageDescriptor, name: &str) -> Option<FieldDescriptor> {
    let own = kind.get_field_by_name(name);
    own.or_else(|| kind.get_field_by_json_name(name))
}

/// The value of a field in a query. JSON of the contract's numbers, names and times may be texts.
fn scalar(field: &FieldDescriptor, name: &str, text: &str) -> Result<Value, RequestError> {
    let no_number = || {
        Err(RequestError::invalid(
            name,
            format!("'{text}' is not a number that it can have"),
        ))
    };
    match field.kind() {
        Kind::Int32 | Kind::Sint32 | Kind::Sfixed32 if text.parse::<i32>().is_err() => no_number(),
        Kind::Uint32 | Kind::Fixed32 if text.parse::<u32>().is_err() => no_number(),
        Kind::Int64 | Kind::Sint64 | Kind::Sfixed64 if text.parse::<i64>().is_err() => no_number(),
        Kind::Uint64 | Kind::Fixed64 if text.parse::<u64>().is_err() => no_number(),
        Kind::Float | Kind::Double if text.parse::<f64>().is_err() => no_number(),
        Kind::Enum(kind) if kind.get_value_by_name(text).is_none() => {
            let names: Vec<String> = kind.values().map(|it| it.name().to_owned()).collect();
            let message = format!("'{text}' is not one of {}", names.join(", "));
            Err(RequestError::invalid(name, message))
        }
        Kind::Bool => match text {
            "true" => Ok(true.into()),
            "false" => Ok(false.into()),
            _ => Err(RequestError::invalid(name, "is neither true nor false")),
        },
        // JSON has the fields of a mask in the form `displayName`.
        Kind::Message(kind) if kind.full_name() == "google.protobuf.FieldMask" => {
            Ok(camel_case(text).into())
        }
        _ => Ok(text.into()),
    }
}

/// `display_name` as `displayName`.
fn camel_case(text: &str) -> String {
    let mut parts = text.split('_');
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |mut name, part| {
        let mut letters = part.chars();
        name.extend(letters.next().map(|it| it.to_ascii_uppercase()));
        name.push_str(letters.as_str());
        name
    })
}

/// The value of a field under either of its names.
fn known<'a>(
    fields: &'a Map<String, Value>,
    kind: &MessageDescriptor,
    name: &str,
) -> Option<&'a Value> {
    let field = of_name(kind, name)?;
    fields
        .get(field.name())
        .or_else(|| fields.get(field.json_name()))
}

/// Sets the field at the path `name`, in place of what the body says of it. `list`: adds to it.
fn set(
    fields: &mut Map<String, Value>,
    kind: &MessageDescriptor,
    name: &str,
    value: Value,
    list: bool,
) -> Result<(), RequestError> {
    let refused = || RequestError::invalid(name, "belongs to a value that is not an object");
    let (first, rest) = name.split_once('.').unwrap_or((name, ""));
    let field = of_name(kind, first).ok_or_else(refused)?;
    let own = field.name().to_owned();
    let before = fields.remove(field.json_name());
    let before = fields.remove(&own).or(before);
    let value = match (rest, field.kind()) {
        ("", _) if list => match before {
            Some(Value::Array(mut values)) => {
                values.push(value);
                Value::Array(values)
            }
            _ => Value::Array(vec![value]),
        },
        ("", _) => value,
        (rest, Kind::Message(inner)) => {
            let mut within = match before {
                None => Map::new(),
                Some(Value::Object(within)) => within,
                Some(_) => return Err(refused()),
            };
            set(&mut within, &inner, rest, value, list)?;
            Value::Object(within)
        }
        _ => return Err(refused()),
    };
    fields.insert(own, value);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::bindings::find;
    use super::*;
    use axum::http::Method;
    use yoto_proto::v1::{
        CreateJobRequest, GetJobRequest, JobView, ListJobsRequest, UpdateSubjectRequest, job,
    };

    fn read(verb: Method, path: &str, sent: &HttpInput<'_>) -> Result<DynamicMessage, String> {
        let found = find(&verb, path).expect("a call");
        message(&found, sent).map_err(|error| error.to_string())
    }

    fn asked<T: prost::Message + Default>(verb: Method, path: &str, sent: &HttpInput<'_>) -> T {
        let message = read(verb, path, sent).expect("a request");
        message.transcode_to().expect("its message")
    }

    #[test]
    fn path_query_and_body_become_fields() {
        let job: GetJobRequest = asked(Method::GET, "/v1/jobs/7", &HttpInput::default());
        assert_eq!(job.name, "jobs/7");
        let sent = HttpInput {
            query: "pageSize=3&states=QUEUED&states=RUNNING&view=JOB_VIEW_FULL&owner=a%20b",
            ..HttpInput::default()
        };
        let jobs: ListJobsRequest = asked(Method::GET, "/v1/jobs", &sent);
        assert_eq!((jobs.page_size, jobs.owner.as_str()), (3, "a b"));
        let states = [job::State::Queued, job::State::Running].map(i32::from);
        assert_eq!(jobs.states, states);
        assert_eq!(jobs.view(), JobView::Full);
        let sent = HttpInput {
            query: "update_mask=display_name,consentNote",
            body: br#"{"display_name": "Ada", "name": "subjects/other"}"#,
            ..HttpInput::default()
        };
        let update: UpdateSubjectRequest = asked(Method::PATCH, "/v1/subjects/ada", &sent);
        let subject = update.subject.expect("a person");
        assert_eq!(subject.display_name, "Ada");
        assert_eq!(subject.name, "subjects/ada", "the path says it");
        let mask = update.update_mask.expect("a mask").paths;
        assert_eq!(mask, ["display_name", "consent_note"]);
    }

    #[test]
    fn an_idempotency_key_is_the_request_id_unless_the_body_has_one() {
        let sent = |body| HttpInput {
            body,
            idempotency_key: Some("key"),
            ..HttpInput::default()
        };
        let job: CreateJobRequest = asked(Method::POST, "/v1/jobs", &sent(b"{}"));
        assert_eq!(job.request_id, "key");
        let body = br#"{"requestId": "own"}"#;
        let job: CreateJobRequest = asked(Method::POST, "/v1/jobs", &sent(body));
        assert_eq!(job.request_id, "own");
        let job: GetJobRequest = asked(Method::GET, "/v1/jobs/7", &sent(b""));
        assert_eq!(job.name, "jobs/7");
    }

    #[test]
    fn what_is_no_request_is_told_by_its_field() {
        let get = |query| {
            let sent = HttpInput {
                query,
                ..HttpInput::default()
            };
            read(Method::GET, "/v1/jobs", &sent).expect_err("refused")
        };
        assert_eq!(get("colour=red"), "colour: there is no such field");
        assert_eq!(
            get("page_size=many"),
            "page_size: 'many' is not a number that it can have"
        );
        let asleep = get("states=ASLEEP");
        assert!(
            asleep.starts_with("states: 'ASLEEP' is not one of STATE_UNSPECIFIED, QUEUED"),
            "{asleep}"
        );
        assert_eq!(get("model.name=a"), "model.name: there is no such field");
        let post = |body: &[u8]| {
            let sent = HttpInput {
                body,
                ..HttpInput::default()
            };
            read(Method::POST, "/v1/jobs", &sent).expect_err("refused")
        };
        assert!(post(b"[]").contains("not a JSON object"));
        assert!(post(b"{").contains("not JSON"));
        assert!(post(br#"{"speck": {}}"#).contains("speck"));
        let many = format!("{{\"spec\": [{}]}}", "{},".repeat(MOST_PARTS));
        assert!(post(many.as_bytes()).contains("parts"));
        let sent = HttpInput {
            body: b"{}",
            ..HttpInput::default()
        };
        let got = read(Method::GET, "/v1/jobs", &sent).expect_err("refused");
        assert!(got.contains("takes no body"), "{got}");
    }
}
