//! What the coordinator answers over HTTP beside gRPC: the calls of the contract with JSON ([`transcoding`]), gRPC-Web, and
//! refusals in the form that a caller understands.
//!
//! All of it is merged into the router of gRPC's services, so connections and calls count towards the same limits.

pub mod file_kind;
pub mod job_files;
pub mod transcoding;
mod web;

pub use web::{NoOrigin, WebLayer, cors};

use axum::http::header::{CONTENT_TYPE, WWW_AUTHENTICATE};
use axum::http::{HeaderMap, HeaderValue, Response, StatusCode};
use bytes::Bytes;
use http_body_util::{BodyExt, Full};
use tonic::body::Body;
use tonic::{Code, Status};

/// Whether a request with these headers is a call of gRPC.
pub fn is_grpc(headers: &HeaderMap) -> bool {
    let kind = headers.get(CONTENT_TYPE);
    kind.is_some_and(|it| it.as_bytes().starts_with(b"application/grpc"))
}

/// The answer to an unknown path.
pub fn unknown(grpc: bool) -> Response<Body> {
    match grpc {
        true => Status::unimplemented("").into_http(),
        false => text(StatusCode::NOT_FOUND, "there is no such page"),
    }
}

/// The answer to a caller who may not call.
pub fn refusal(status: &Status, grpc: bool) -> Response<Body> {
    match grpc {
        true => status.clone().into_http(),
        false => refused(status),
    }
}

/// A refusal in one line.
fn refused(status: &Status) -> Response<Body> {
    let code = match status.code() {
        Code::Unauthenticated => StatusCode::UNAUTHORIZED,
        Code::PermissionDenied => StatusCode::FORBIDDEN,
        _ => StatusCode::SERVICE_UNAVAILABLE,
    };
    let mut refused = text(code, status.message());
    if code == StatusCode::UNAUTHORIZED {
        let scheme = HeaderValue::from_static("Bearer");
        refused.headers_mut().insert(WWW_AUTHENTICATE, scheme);
    }
    refused
}

/// A page with one line.
pub fn text(code: StatusCode, line: &str) -> Response<Body> {
    let body = Full::new(Bytes::from(format!("{line}\n"))).map_err(|never| match never {});
    let mut page = Response::new(Body::new(body));
    *page.status_mut() = code;
    page
}
