//! A page that can't be shown: the error of a call, in words.

use super::document;
use super::words::told;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use maud::html;
use tonic::{Code, Status};

/// Why a page can't be shown.
#[derive(Debug)]
pub(crate) struct PageError {
    status: StatusCode,
    words: String,
}

impl PageError {
    /// One with these words.
    pub(crate) fn of(status: StatusCode, words: impl Into<String>) -> Self {
        Self {
            status,
            words: words.into(),
        }
    }
}

impl From<Status> for PageError {
    fn from(error: Status) -> Self {
        Self::of(status(error.code()), error.message())
    }
}

/// The status of HTTP that means the same, as in `google.rpc.Code`.
fn status(code: Code) -> StatusCode {
    match code {
        Code::Ok => StatusCode::OK,
        Code::InvalidArgument | Code::OutOfRange => StatusCode::BAD_REQUEST,
        Code::Unauthenticated => StatusCode::UNAUTHORIZED,
        Code::PermissionDenied => StatusCode::FORBIDDEN,
        Code::NotFound => StatusCode::NOT_FOUND,
        Code::AlreadyExists | Code::Aborted | Code::FailedPrecondition => StatusCode::CONFLICT,
        Code::ResourceExhausted => StatusCode::TOO_MANY_REQUESTS,
        Code::Unimplemented => StatusCode::NOT_IMPLEMENTED,
        Code::Unavailable => StatusCode::SERVICE_UNAVAILABLE,
        Code::DeadlineExceeded => StatusCode::GATEWAY_TIMEOUT,
        Code::Cancelled | Code::Unknown | Code::Internal | Code::DataLoss => {
            StatusCode::INTERNAL_SERVER_ERROR
        }
    }
}

/// The heading of an error page.
fn heading(status: StatusCode) -> &'static str {
    match status {
        StatusCode::NOT_FOUND => "Not found",
        StatusCode::BAD_REQUEST => "The address is wrong",
        StatusCode::FORBIDDEN | StatusCode::UNAUTHORIZED => "Not allowed",
        StatusCode::CONFLICT => "Not possible now",
        StatusCode::SERVICE_UNAVAILABLE | StatusCode::TOO_MANY_REQUESTS => "Try again later",
        _ => "The service has failed",
    }
}

impl IntoResponse for PageError {
    fn into_response(self) -> Response {
        let heading = heading(self.status);
        let body = html! {
            h1 { (heading) }
            p .message { (told(&self.words)) }
            p { a href="/" { "To the overview" } }
        };
        (self.status, document::still(heading, body)).into_response()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_has_its_status_and_no_markup_of_others() {
        let error = PageError::from(Status::not_found("jobs/<script>\u{202e} does not exist"));
        assert_eq!(error.status, StatusCode::NOT_FOUND);
        let page = document::still("x", html! { (told(&error.words)) }).0;
        assert!(page.contains("jobs/&lt;script&gt;\\u{202e} does"), "{page}");
        for code in 1..=16 {
            assert!(status(Code::from_i32(code)).as_u16() >= 400, "{code}");
        }
    }
}
