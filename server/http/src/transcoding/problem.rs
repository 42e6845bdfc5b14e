//! Errors over HTTP: `application/problem+json` (RFC 9457), with the reason and the fields of the gRPC error.

use axum::body::Body;
use axum::http::header::{CONTENT_TYPE, RETRY_AFTER, WWW_AUTHENTICATE};
use axum::http::{HeaderValue, Response, StatusCode};
use serde_json::{Value, json};
use tonic::{Code, Status};
use tonic_types::StatusExt;

/// The media type.
const KIND: &str = "application/problem+json";
/// Seconds after which a call that can't be answered now may be made again, unless the error says.
const LATER: u64 = 2;

/// The answer that tells an error.
pub(super) fn answer(status: &Status) -> Response<Body> {
    let mut answer = Response::new(Body::from(told(status).to_string()));
    *answer.status_mut() = http_code(status.code());
    let headers = answer.headers_mut();
    headers.insert(CONTENT_TYPE, HeaderValue::from_static(KIND));
    if status.code() == Code::Unauthenticated {
        headers.insert(WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
    }
    if matches!(status.code(), Code::Unavailable | Code::ResourceExhausted) {
        let details = status.get_error_details();
        let told = details.retry_info().and_then(|it| it.retry_delay);
        let seconds = told.map_or(LATER, |it| it.as_secs().max(1));
        headers.insert(RETRY_AFTER, seconds.into());
    }
    answer
}

/// The object that tells an error.
pub(super) fn told(status: &Status) -> Value {
    let details = status.get_error_details();
    let faults = details.bad_request().map(|it| it.field_violations.clone());
    let faults: Vec<Value> = faults
        .into_iter()
        .flatten()
        .map(|it| json!({ "field": it.field, "detail": it.description }))
        .collect();
    let conditions = details.precondition_failure();
    let conditions = conditions.map(|it| it.violations.clone());
    let conditions: Vec<Value> = conditions
        .into_iter()
        .flatten()
        .map(|it| json!({ "reason": it.r#type, "subject": it.subject, "detail": it.description }))
        .collect();
    let mut problem = json!({
        "type": "about:blank",
        "title": name(status.code()),
        "status": http_code(status.code()).as_u16(),
        "detail": status.message(),
    });
    if let Some(info) = details.error_info() {
        problem["reason"] = info.reason.clone().into();
    }
    if !faults.is_empty() {
        problem["fields"] = faults.into();
    }
    if !conditions.is_empty() {
        problem["conditions"] = conditions.into();
    }
    problem
}

/// The answer to an unknown path.
pub(super) fn unknown() -> Response<Body> {
    answer(&Status::not_found(
        "there is no such call: /v1/openapi.json describes all",
    ))
}

/// As Google's APIs map the codes (`google/rpc/code.proto`).
fn http_code(code: Code) -> StatusCode {
    match code {
        Code::Ok => StatusCode::OK,
        Code::InvalidArgument | Code::FailedPrecondition | Code::OutOfRange => {
            StatusCode::BAD_REQUEST
        }
        Code::Unauthenticated => StatusCode::UNAUTHORIZED,
        Code::PermissionDenied => StatusCode::FORBIDDEN,
        Code::NotFound => StatusCode::NOT_FOUND,
        Code::AlreadyExists | Code::Aborted => StatusCode::CONFLICT,
        Code::ResourceExhausted => StatusCode::TOO_MANY_REQUESTS,
        Code::Unimplemented => StatusCode::NOT_IMPLEMENTED,
        Code::Unavailable => StatusCode::SERVICE_UNAVAILABLE,
        Code::DeadlineExceeded => StatusCode::GATEWAY_TIMEOUT,
        Code::Cancelled | Code::Unknown | Code::Internal | Code::DataLoss => {
            StatusCode::INTERNAL_SERVER_ERROR
        }
    }
}

/// The name of a code in the contract: `NOT_FOUND`.
fn name(code: Code) -> String {
    let mut name = String::new();
    for (at, letter) in format!("{code:?}").char_indices() {
        if at > 0 && letter.is_uppercase() {
            name.push('_');
        }
        name.push(letter.to_ascii_uppercase());
    }
    name
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_proto::v1::ErrorReason;
    use yoto_request::RequestError;

    async fn told(error: RequestError) -> (StatusCode, Value) {
        let answer = answer(&error.into());
        let code = answer.status();
        let body = axum::body::to_bytes(answer.into_body(), 1 << 20).await;
        let body = body.expect("a body");
        (code, serde_json::from_slice(&body).expect("JSON"))
    }

    #[tokio::test]
    async fn a_problem_has_the_fields_and_the_reason() {
        let (code, problem) = told(RequestError::invalid("spec.steps", "is 0")).await;
        assert_eq!(code, 400);
        assert_eq!(problem["title"], "INVALID_ARGUMENT");
        assert_eq!(problem["fields"][0]["field"], "spec.steps");
        let missing = RequestError::refused(ErrorReason::KeyMissing, "a key");
        let (code, problem) = told(missing).await;
        assert_eq!(
            (code.as_u16(), &problem["reason"]),
            (401, &json!("KEY_MISSING"))
        );
    }

    #[test]
    fn a_busy_service_says_when_to_come_again() {
        let answer = answer(&RequestError::Busy("calls".to_owned()).into());
        assert_eq!(answer.status(), StatusCode::SERVICE_UNAVAILABLE);
        assert!(answer.headers().contains_key(RETRY_AFTER));
    }
}
