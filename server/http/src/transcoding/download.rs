//! Files over HTTP: whole or a range of them, so that a browser or `curl -C -` continues where it stopped.

use super::bindings::BoundCall;
use super::call::{call, framed};
use super::{Calls, problem};
use crate::file_kind::FileKind;
use axum::body::Body;
use axum::http::header::{
    ACCEPT_RANGES, CONTENT_DISPOSITION, CONTENT_LENGTH, CONTENT_RANGE, CONTENT_SECURITY_POLICY,
    CONTENT_TYPE, ETAG, IF_NONE_MATCH, IF_RANGE, RANGE, X_CONTENT_TYPE_OPTIONS,
};
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderValue, Method, Response, StatusCode};
use futures::StreamExt;
use prost::Message;
use std::ops::Range;
use tonic::Status;
use yoto_proto::v1::{DownloadObjectRequest, DownloadObjectResponse};
use yoto_request::RequestError;
use yoto_store::Tenant;

/// What a request asks for of a file.
#[derive(Debug, PartialEq, Eq)]
enum RequestedBytes {
    All,
    Part(Range<u64>),
    /// What it has already.
    Nothing,
    /// Bytes that the file does not have.
    Beyond,
}

/// Answers with the file that `found` names.
pub(super) async fn answer(calls: &Calls, parts: &Parts, found: &BoundCall) -> Response<Body> {
    match file(calls, parts, found).await {
        Ok(answer) => answer,
        Err(status) => problem::answer(&status),
    }
}

async fn file(calls: &Calls, parts: &Parts, found: &BoundCall) -> Result<Response<Body>, Status> {
    if let Some(query) = parts.uri.query().filter(|it| !it.is_empty()) {
        let name: String = query.chars().take_while(|it| *it != '=').collect();
        let message = "there is no such field: the header Range has the bytes that are wanted";
        return Err(RequestError::invalid(name, message).into());
    }
    let tenant = parts.extensions.get::<Tenant>();
    let tenant = tenant.cloned().ok_or(RequestError::NoTenant)?;
    let name = found.values.first().map_or("", |(_, name)| name);
    let object = calls.objects.named(&tenant, name).await?;
    let etag = format!("\"{}\"", object.sha256);
    let wanted = wanted(&parts.headers, &etag, object.bytes);
    let (code, range) = match wanted {
        RequestedBytes::All => (StatusCode::OK, 0..object.bytes),
        RequestedBytes::Part(range) => (StatusCode::PARTIAL_CONTENT, range),
        RequestedBytes::Nothing => (StatusCode::NOT_MODIFIED, 0..0),
        RequestedBytes::Beyond => (StatusCode::RANGE_NOT_SATISFIABLE, 0..0),
    };
    let length = range.end - range.start;
    let sends = length > 0 && parts.method != Method::HEAD;
    let body = match sends {
        false => Body::empty(),
        true => {
            let request = DownloadObjectRequest {
                name: name.to_owned(),
                offset: range.start,
                length,
            };
            let message = framed(&request.encode_to_vec())?;
            let path = &found.binding.path;
            let answers = call(calls.services.clone(), parts, path, message.into()).await?;
            let chunks = answers.stream().map(|message| {
                let answer = DownloadObjectResponse::decode(message?);
                let answer = answer.map_err(|error| Status::internal(error.to_string()))?;
                Ok::<_, Status>(answer.chunk)
            });
            Body::from_stream(chunks)
        }
    };
    let mut answer = Response::new(body);
    *answer.status_mut() = code;
    let headers = answer.headers_mut();
    let text =
        |text: String| HeaderValue::from_str(&text).map_err(|_| Status::internal("a header"));
    headers.insert(ETAG, text(etag)?);
    headers.insert(ACCEPT_RANGES, HeaderValue::from_static("bytes"));
    headers.insert(X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    if code == StatusCode::NOT_MODIFIED {
        return Ok(answer);
    }
    let bytes = object.bytes;
    match code {
        StatusCode::PARTIAL_CONTENT => {
            let told = format!("bytes {}-{}/{bytes}", range.start, range.end - 1);
            headers.insert(CONTENT_RANGE, text(told)?);
        }
        StatusCode::RANGE_NOT_SATISFIABLE => {
            headers.insert(CONTENT_RANGE, text(format!("bytes */{bytes}"))?);
        }
        _ => {}
    }
    headers.insert(CONTENT_LENGTH, length.into());
    let file = name.rsplit('/').next().unwrap_or_default();
    let kind = match FileKind::of(file) {
        FileKind::Picture(kind) => kind,
        FileKind::Player => "text/html; charset=utf-8",
        FileKind::Other => "application/octet-stream",
    };
    headers.insert(CONTENT_TYPE, HeaderValue::from_static(kind));
    // A worker has written it: it is kept as a file, and never acts as a page of the service.
    headers.insert(CONTENT_DISPOSITION, text(disposition(file))?);
    let policy = HeaderValue::from_static("sandbox; default-src 'none'");
    headers.insert(CONTENT_SECURITY_POLICY, policy);
    Ok(answer)
}

fn disposition(file: &str) -> String {
    let plain = |it: char| it.is_ascii_alphanumeric() || matches!(it, '.' | '_' | '-');
    match file.chars().all(plain) {
        true => format!("attachment; filename=\"{file}\""),
        false => "attachment".to_owned(),
    }
}

/// What the headers of a request ask for of a file of `bytes` bytes (RFC 9110, 13 and 14). A range that is none, or several of
/// them, ask for all.
fn wanted(headers: &HeaderMap, etag: &str, bytes: u64) -> RequestedBytes {
    let text = |name| {
        headers
            .get(name)
            .and_then(|it: &HeaderValue| it.to_str().ok())
    };
    // A weak tag matches here (RFC 9110, 13.1.2), and not in `If-Range`.
    let known = |tags: &str| {
        let mut tags = tags.split(',').map(str::trim);
        tags.any(|it| it.trim_start_matches("W/") == etag || it == "*")
    };
    if text(IF_NONE_MATCH).is_some_and(known) {
        return RequestedBytes::Nothing;
    }
    if text(IF_RANGE).is_some_and(|it| it != etag) {
        return RequestedBytes::All;
    }
    let range = text(RANGE).and_then(|it| it.strip_prefix("bytes="));
    let Some((first, last)) = range.and_then(|it| it.split_once('-')) else {
        return RequestedBytes::All;
    };
    let number = |text: &str| text.parse::<u64>().ok();
    let part = |begin: u64, end: u64| match begin < end {
        true => RequestedBytes::Part(begin..end),
        false => RequestedBytes::Beyond,
    };
    match (number(first), number(last)) {
        (Some(first), None) if last.is_empty() => part(first, bytes),
        (Some(first), Some(last)) if first <= last => {
            part(first, last.saturating_add(1).min(bytes))
        }
        (None, Some(count)) if first.is_empty() => part(bytes - count.min(bytes), bytes),
        _ => RequestedBytes::All,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(headers: &[(axum::http::HeaderName, &'static str)]) -> RequestedBytes {
        let headers = headers.iter().cloned();
        let headers = headers.map(|(name, value)| (name, HeaderValue::from_static(value)));
        wanted(&headers.collect(), "\"tag\"", 10)
    }

    #[test]
    fn ranges_are_those_of_the_standard() {
        for (range, expected) in [
            ("bytes=2-4", RequestedBytes::Part(2..5)),
            ("bytes=2-", RequestedBytes::Part(2..10)),
            ("bytes=2-99", RequestedBytes::Part(2..10)),
            ("bytes=-3", RequestedBytes::Part(7..10)),
            ("bytes=-99", RequestedBytes::Part(0..10)),
            ("bytes=10-", RequestedBytes::Beyond),
            ("bytes=-0", RequestedBytes::Beyond),
            ("bytes=4-2", RequestedBytes::All),
            ("bytes=1-2,4-5", RequestedBytes::All),
            ("lines=1-2", RequestedBytes::All),
            ("bytes=x-2", RequestedBytes::All),
        ] {
            assert_eq!(asked(&[(RANGE, range)]), expected, "{range}");
        }
    }

    #[test]
    fn a_file_that_is_known_is_not_sent_again() {
        assert_eq!(
            asked(&[(IF_NONE_MATCH, "\"a\", \"tag\"")]),
            RequestedBytes::Nothing
        );
        assert_eq!(
            asked(&[(IF_NONE_MATCH, "W/\"tag\"")]),
            RequestedBytes::Nothing
        );
        assert_eq!(asked(&[(IF_NONE_MATCH, "\"a\"")]), RequestedBytes::All);
        let changed = [(IF_RANGE, "\"a\""), (RANGE, "bytes=2-")];
        assert_eq!(asked(&changed), RequestedBytes::All);
        let same = [(IF_RANGE, "\"tag\""), (RANGE, "bytes=2-")];
        assert_eq!(asked(&same), RequestedBytes::Part(2..10));
    }

    #[test]
    fn a_name_that_needs_quotes_is_left_out() {
        assert_eq!(disposition("0.png"), "attachment; filename=\"0.png\"");
        assert_eq!(disposition("a\".png"), "attachment");
    }
}
