//! The calls of the contract over HTTP with JSON, for programs and pages without gRPC.
//!
//! Which request is which call is said in the contract (`google.api.http`). A request becomes the call's message, which goes to
//! the same services by the same way: rules, tenants and limits are theirs, and nothing here knows a single call but the
//! transfer of files. docs/operate/http.md is the page for users.
//!
//! | here | |
//! |---|---|
//! | [`template`], [`bindings`] | paths, and which call they are |
//! | [`request`], [`json`] | messages from and to JSON |
//! | [`call`] | the call inside the process |
//! | [`stream`], [`problem`] | answers that are streams, and errors |
//! | [`download`], [`upload`] | bytes of files |
//! | [`openapi`] | the description of all requests |

mod bindings;
mod call;
mod download;
mod json;
mod openapi;
mod problem;
mod request;
mod stream;
mod template;
mod unique;
mod upload;

pub use json::of as json_of;

use axum::Router;
use axum::body::{Body, to_bytes};
use axum::extract::{Request, State};
use axum::http::header::CONTENT_TYPE;
use axum::http::{HeaderValue, Method, Response};
use bindings::{BoundCall, DOWNLOAD, PREFIX};
use prost_reflect::ReflectMessage;
use prost_reflect::prost::Message;
use request::HttpInput;
use std::sync::Arc;
use tonic::Status;
use yoto_process::metrics::METRICS;
use yoto_proto::v1::ObjectRef;
use yoto_request::RequestError;
use yoto_request::methods::is_unary;
use yoto_store::Tenant;

/// The header that makes a repeated request one.
const IDEMPOTENCY_KEY: &str = "idempotency-key";
/// The description of all requests.
const OPENAPI: &str = "/v1/openapi.json";

/// What a request needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Needed {
    /// What the call at this path of gRPC needs.
    Call(&'static str),
    /// What reflection needs: the contract is public, but who asks has a key.
    Contract,
}

/// The services that are called.
#[derive(Clone)]
struct Calls {
    services: Router,
    objects: Arc<dyn NamedObjects>,
}

/// What a download over HTTP has to know before its call begins: length and checksum of the object.
#[tonic::async_trait]
pub trait NamedObjects: Send + Sync {
    /// The object called `name`, `{parent}/objects/{file}`.
    ///
    /// # Errors
    /// When the name is malformed, or the tenant has no such object.
    async fn named(&self, tenant: &Tenant, name: &str) -> Result<ObjectRef, RequestError>;
}

/// All requests, as calls of `services`.
pub fn routes(services: Router, objects: Arc<dyn NamedObjects>) -> Router {
    let calls = Calls { services, objects };
    let all = axum::routing::any(answer_to).with_state(calls);
    Router::new().route("/v1/{*path}", all)
}

/// Whether the path is one of these requests, if it is any.
pub fn is_request(path: &str) -> bool {
    path.starts_with(PREFIX)
}

/// What a request needs; `None` if there is none.
pub fn needed(verb: &Method, path: &str) -> Option<Needed> {
    if path == OPENAPI && (verb == Method::GET || verb == Method::HEAD) {
        return Some(Needed::Contract);
    }
    if upload::target(verb, path).is_some() {
        return Some(Needed::Call(upload::CALL));
    }
    bindings::find(verb, path).map(|found| Needed::Call(&found.binding.path))
}

/// Whether the request or its answer is a stream, which may take long.
pub fn streams(verb: &Method, path: &str) -> bool {
    matches!(needed(verb, path), Some(Needed::Call(call)) if !is_unary(call))
}

/// The answer to an unknown path.
pub fn unknown() -> Response<Body> {
    problem::unknown()
}

/// The answer to a caller who may not call.
pub fn refusal(status: &Status) -> Response<Body> {
    problem::answer(status)
}

async fn answer_to(State(calls): State<Calls>, request: Request) -> Response<Body> {
    let (parts, body) = request.into_parts();
    let path = parts.uri.path();
    if path == OPENAPI {
        return answer(openapi::TEXT.clone());
    }
    if let Some(target) = upload::target(&parts.method, path) {
        METRICS.called(upload::CALL);
        return upload::answer(&calls, &parts, target, body).await;
    }
    let Some(found) = bindings::find(&parts.method, path) else {
        return unknown();
    };
    METRICS.called(&found.binding.path);
    if found.binding.path == DOWNLOAD {
        return download::answer(&calls, &parts, &found).await;
    }
    let asked = Request::from_parts(parts, body);
    match call_of(&calls, asked, &found).await {
        Ok(answer) => answer,
        Err(status) => problem::answer(&status),
    }
}

/// Whether the value of a header Content-Type is that of JSON, which is UTF-8 (RFC 8259, 8.1).
fn is_json(kind: &str) -> bool {
    let mut parts = kind.split(';').map(str::trim);
    let json = |it: &str| it.eq_ignore_ascii_case("application/json");
    let good = |parameter: &str| match parameter.split_once('=') {
        Some((name, value)) if name.trim().eq_ignore_ascii_case("charset") => {
            value.trim().trim_matches('"').eq_ignore_ascii_case("utf-8")
        }
        _ => true,
    };
    parts.next().is_some_and(json) && parts.all(good)
}

async fn call_of(
    calls: &Calls,
    asked: Request,
    found: &BoundCall,
) -> Result<Response<Body>, Status> {
    let (mut parts, body) = asked.into_parts();
    let body = to_bytes(body, request::LONGEST).await.map_err(|_| {
        let message = format!("is longer than {} bytes, or broke off", request::LONGEST);
        RequestError::invalid("body", message)
    })?;
    let kind = parts.headers.get(CONTENT_TYPE);
    let is_json = kind.and_then(|it| it.to_str().ok()).is_some_and(is_json);
    if !body.is_empty() && !is_json {
        let message = "is not of the type application/json, in UTF-8";
        return Err(RequestError::invalid("Content-Type", message).into());
    }
    let text = |name: &str| parts.headers.get(name).and_then(|it| it.to_str().ok());
    let sent = HttpInput {
        query: parts.uri.query().unwrap_or_default(),
        body: &body,
        idempotency_key: text(IDEMPOTENCY_KEY),
    };
    let mut message = request::message(found, &sent)?;
    if let Some(last) = text(stream::LAST_EVENT).and_then(|it| it.parse().ok())
        && message
            .descriptor()
            .get_field_by_name(stream::AFTER)
            .is_some()
    {
        message.set_field_by_name(stream::AFTER, prost_reflect::Value::U64(last));
    }
    let message = call::framed(&message.encode_to_vec())?;
    // A message that was read is no longer needed beside its copy.
    drop(body);
    let headers = std::mem::take(&mut parts.headers);
    let services = calls.services.clone();
    let path = &found.binding.path;
    let answers = call::call(services, &parts, path, message.into()).await?;
    if found.binding.streams() {
        return Ok(stream::answer(found.binding, answers, &headers).await);
    }
    let output = found.binding.method.output();
    let message = json::read(output, &answers.single().await?)?;
    Ok(answer(json::text(&message)?))
}

/// An answer of JSON.
fn answer(text: String) -> Response<Body> {
    let mut answer = Response::new(Body::from(text));
    let json = HeaderValue::from_static("application/json");
    answer.headers_mut().insert(CONTENT_TYPE, json);
    answer
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_is_utf_8() {
        for good in [
            "application/json",
            "Application/JSON; charset=UTF-8",
            "application/json;charset=\"utf-8\"; x=y",
        ] {
            assert!(is_json(good), "{good}");
        }
        for bad in [
            "",
            "text/json",
            "application/json-patch+json",
            "application/json; charset=utf-16",
        ] {
            assert!(!is_json(bad), "{bad}");
        }
    }

    #[test]
    fn each_request_needs_what_its_call_needs() {
        let call = |verb, path| match needed(&verb, path) {
            Some(Needed::Call(call)) => Some(call),
            _ => None,
        };
        let get = |path| call(Method::GET, path);
        assert_eq!(get("/v1/jobs/7"), Some("/yoto.v1.JobService/GetJob"));
        assert_eq!(
            call(Method::PUT, "/v1/uploads/7/files/a"),
            Some("/yoto.v1.UploadService/WriteUpload")
        );
        assert_eq!(needed(&Method::GET, OPENAPI), Some(Needed::Contract));
        assert_eq!(needed(&Method::POST, OPENAPI), None);
        assert_eq!(get("/v1/"), None);
        assert!(streams(&Method::GET, "/v1/jobs:watch"));
        assert!(streams(&Method::PUT, "/v1/uploads/7/files/a"));
        assert!(!streams(&Method::GET, "/v1/jobs"));
    }
}
