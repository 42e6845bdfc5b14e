//! The page where people sign in. It stands at its own address, and in place of every page that asks for a key.

use super::{BY_KEY, START};
use crate::access::{cookies, page_of};
use crate::config::OidcConfig;
use axum::http::header::{LOCATION, SET_COOKIE, WWW_AUTHENTICATE};
use axum::http::{HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use maud::html;
use url::form_urlencoded::byte_serialize;
use yoto_dashboard as dashboard;

/// Longest address of a page that is gone to, bytes: it stands in a cookie.
const LONGEST: usize = 500;

/// The page, with why somebody must sign in, who then sees the page `to`.
pub(super) fn shown(oidc: Option<&OidcConfig>, to: &str, why: &str) -> Response {
    let to = own(to);
    let query: String = byte_serialize(to.as_bytes()).collect();
    let body = html! {
        h1 { "Sign in" }
        @if !why.is_empty() { p .message .warn role="status" { (why) } }
        @if let Some(oidc) = oidc {
            p { a .button href={ (START) "?to=" (query) } { "Sign in with " (oidc.host()) } }
            h2 { "Or with a key" }
        }
        form method="post" action=(BY_KEY) {
            input type="hidden" name="to" value=(to);
            p {
                label { "Key "
                    input type="password" name="key" required autocomplete="current-password" spellcheck="false";
                }
            }
            p { button { "Sign in" } }
        }
        p .detail { "An operator makes keys with " code { "yoto key create" } "." }
    };
    dashboard::outside("Sign in", body)
}

/// The page in place of one that somebody may not see without a key. A form that was sent is not sent again.
pub(crate) fn asked(oidc: Option<&OidcConfig>, to: &str, why: &str) -> Response {
    let mut answer = shown(oidc, to, why);
    *answer.status_mut() = StatusCode::UNAUTHORIZED;
    let scheme = HeaderValue::from_static("Bearer");
    answer.headers_mut().insert(WWW_AUTHENTICATE, scheme);
    answer
}

/// A page with what has gone wrong.
pub(super) fn failed(status: StatusCode, words: &str) -> Response {
    let body = html! {
        h1 { "Nobody was signed in" }
        p .message .bad role="alert" { (words) }
        p { a href=(super::PAGE) { "Try again" } }
    };
    (status, dashboard::outside("Nobody was signed in", body)).into_response()
}

/// Sends the browser to `place`, with what it is to keep.
pub(super) fn moved(
    place: &str,
    cookies: impl IntoIterator<Item = Option<HeaderValue>>,
) -> Response {
    let mut answer = StatusCode::SEE_OTHER.into_response();
    let headers = answer.headers_mut();
    if let Ok(place) = HeaderValue::from_str(place) {
        headers.insert(LOCATION, place);
    }
    for cookie in cookies.into_iter().flatten() {
        headers.append(SET_COOKIE, cookie);
    }
    answer
}

/// Where somebody is sent who has signed out.
pub(crate) fn signed_out() -> Response {
    moved(super::PAGE, cookies::no_session())
}

/// `to` if it is a page of this service that can be asked for; otherwise the first page.
pub(super) fn own(to: &str) -> &str {
    let path = to.split(['?', '#']).next().unwrap_or_default();
    let known = page_of(path).is_some() && !path.starts_with("/sign");
    match known && to.len() <= LONGEST && to.bytes().all(|it| it.is_ascii_graphic()) {
        true => to,
        false => "/",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_pages_of_this_service_are_gone_to() {
        for page in ["/", "/people", "/models/7?x=1", "/jobs/7#a"] {
            assert_eq!(own(page), page);
        }
        for other in [
            "",
            "//evil.example",
            "/\\evil.example",
            "https://evil.example/people",
            "/people\r\nx: y",
            "/sign-out",
            "/v1/jobs",
            "/nothing",
        ] {
            assert_eq!(own(other), "/", "{other}");
        }
    }
}
