//! The middleware that records calls: behind the one that authorizes them, since it needs to know who calls.

use super::{Audit, names};
use crate::access;
use axum::extract::{Request, State};
use axum::http::Method;
use axum::middleware::Next;
use axum::response::Response;
use std::sync::Arc;
use std::time::Instant;
use tonic::{Code, Status};
use yoto_http::{is_grpc, refusal};
use yoto_proto::names::{Collection, is_name};
use yoto_proto::reasons;
use yoto_request::{Caller, methods};
use yoto_store::NewAuditEntry;

/// Calls for each part of an upload: its begin and its end are recorded.
const PARTS: [&str; 2] = [
    "/yoto.v1.UploadService/SignParts",
    "/yoto.v1.UploadService/CommitPart",
];
/// The outcome of a call that was carried out.
const OK: &str = "OK";
/// The outcome of a call that was cut off before its answer.
const CUT_OFF: &str = "CUT_OFF";

/// Records the call, if it changes something.
pub(crate) async fn record(
    State(audit): State<Arc<Audit>>,
    request: Request,
    next: Next,
) -> Response {
    let Some((call, named)) = recorded(&request) else {
        return next.run(request).await;
    };
    let grpc = is_grpc(request.headers());
    let Some(caller) = request.extensions().get::<Caller>().cloned() else {
        // Nobody is answered without a tenant.
        return next.run(request).await;
    };
    if let Err(error) = audit.budget.check(&caller, Instant::now()) {
        return refusal(&Status::from(error), grpc).map(axum::body::Body::new);
    }
    let made = methods::response(&call);
    let (request, names) = match methods::request(&call) {
        Some(message) => names::of(request, message).await,
        None => (request, named),
    };
    let entry = NewAuditEntry {
        tenant: caller.id().to_owned(),
        key: caller.key().unwrap_or_default().to_owned(),
        call,
        names,
        began: None,
        outcome: String::new(),
    };
    let begun = match audit.begin(entry.clone()).await {
        Ok(number) => Begun {
            audit,
            caller,
            entry: Some(NewAuditEntry {
                began: Some(number),
                ..entry
            }),
        },
        Err(error) => return refusal(&Status::from(error), grpc).map(axum::body::Body::new),
    };
    let answer = next.run(request).await;
    let (outcome, refused) = outcome(&answer, grpc);
    if refused {
        begun.refused();
    }
    let (answer, made) = match made {
        Some(message) if outcome == OK => names::of_answer(answer, message).await,
        _ => (answer, String::new()),
    };
    begun.end(outcome, made).await;
    answer
}

/// A call that has begun. If its future is dropped, it was cut off: the connection is lost, or its time is over.
struct Begun {
    audit: Arc<Audit>,
    caller: Caller,
    entry: Option<NewAuditEntry>,
}

impl Begun {
    /// Counts the call in the caller's budget of refused ones.
    fn refused(&self) {
        self.audit.budget.spend(&self.caller, Instant::now());
    }

    /// `made`: the resource in the answer.
    async fn end(mut self, outcome: String, made: String) {
        if let Some(entry) = self.entry.take() {
            let known = made.is_empty() || entry.names.split(' ').any(|it| it == made);
            let names = match (known, entry.names.is_empty()) {
                (true, _) => entry.names,
                (false, true) => made,
                (false, false) => format!("{} {made}", entry.names),
            };
            let entry = NewAuditEntry {
                outcome,
                names,
                ..entry
            };
            self.audit.end(entry).await;
        }
    }
}

impl Drop for Begun {
    fn drop(&mut self) {
        if let Some(entry) = self.entry.take() {
            self.refused();
            let outcome = CUT_OFF.to_owned();
            self.audit.end_now(NewAuditEntry { outcome, ..entry });
        }
    }
}

/// What is recorded as the call, if it changes something: the path of a method; or verb and path of a form of the dashboard, and the
/// resource that its path names. Requests of a page's script become calls, which are recorded.
fn recorded(request: &Request) -> Option<(String, String)> {
    let path = request.uri().path();
    if access::is_of_script(path) {
        return None;
    }
    if let Some(pattern) = access::page_of(path) {
        let named = named(path);
        return (request.method() == Method::POST).then(|| (format!("POST {pattern}"), named));
    }
    let changes = access::changes_something(path) && methods::is_unary(path);
    (changes && !PARTS.contains(&path)).then(|| (path.to_owned(), String::new()))
}

/// The resource whose page `path` is or is below; empty if there is none.
fn named(path: &str) -> String {
    let mut segments = path.trim_start_matches('/').splitn(3, '/');
    let (collection, id) = (segments.next(), segments.next());
    let collection = match collection.unwrap_or_default() {
        // Their page has another word for them.
        "people" => Collection::Subjects.as_str(),
        other => other,
    };
    let name = format!("{collection}/{}", id.unwrap_or_default());
    if is_name(&name) { name } else { String::new() }
}

/// `OK`, the reason of a refusal, or its code; of a page, the status. And whether the call was refused.
fn outcome(answer: &Response, grpc: bool) -> (String, bool) {
    if !grpc {
        let status = answer.status();
        let refused = status.is_client_error() || status.is_server_error();
        return (status.as_u16().to_string(), refused);
    }
    // A refusal of a unary call has no body: its status stands in the headers.
    match Status::from_header_map(answer.headers()) {
        None => (OK.to_owned(), false),
        Some(status) if status.code() == Code::Ok => (OK.to_owned(), false),
        Some(status) => {
            let code = || format!("{:?}", status.code());
            (reasons::spelled(&status).unwrap_or_else(code), true)
        }
    }
}
