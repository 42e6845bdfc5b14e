//! The key that a call has in its header.

use super::browser;
use super::cookies::session_of;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use tonic::body::Body;
use tonic::codegen::http::header::COOKIE;
use tonic::codegen::http::{HeaderMap, Method, Request, Uri};
use yoto_proto::key::{HEADER, SCHEME, is_key};
use yoto_request::RequestError;

/// What a browser has before user name and password (RFC 7617).
const BASIC: &str = "Basic ";

/// What of a call says who makes it.
pub(super) struct CallHead {
    pub method: Method,
    pub uri: Uri,
    pub headers: HeaderMap,
    pub key: Option<SentKey>,
}

/// What a caller has sent as its key; empty if it is none.
pub(super) enum SentKey {
    /// By a program, which chose to send it.
    Chosen(String),
    /// By a browser, in the cookie of a session or as the password of a user of any name. It sends it with every request to this
    /// service, also for pages of other sites.
    Kept(String),
}

impl SentKey {
    /// The key, if the caller meant to send it.
    ///
    /// # Errors
    /// When a page of another site has the browser send it.
    pub(super) fn of_caller(&self, head: &CallHead) -> Result<&str, RequestError> {
        match self {
            Self::Chosen(key) => Ok(key),
            Self::Kept(key) => {
                if !browser::shows_page(&head.method, &head.headers) {
                    browser::check(&head.uri, &head.headers, false)?;
                }
                Ok(key)
            }
        }
    }
}

impl CallHead {
    /// Takes the key out of the request: nothing behind the layer needs it, or can log it. For a `page`, it can be in a cookie, or a
    /// password.
    pub(super) fn of(request: &mut Request<Body>, page: bool) -> Self {
        let sent = request.headers_mut().remove(HEADER);
        let chosen = sent
            .as_ref()
            .and_then(|it| it.to_str().ok())
            .map(|text| sent_as(text, page));
        let session = page.then(|| session_of(request.headers())).flatten();
        if page {
            request.headers_mut().remove(COOKIE);
        }
        // A header without a key of this service may be a proxy's.
        let is_own = |sent: &SentKey| match sent {
            SentKey::Chosen(key) | SentKey::Kept(key) => !key.is_empty(),
        };
        let session = session.as_deref().map(own).map(SentKey::Kept);
        let key = match chosen {
            Some(chosen) if is_own(&chosen) || session.is_none() => Some(chosen),
            _ => session,
        };
        Self {
            method: request.method().clone(),
            uri: request.uri().clone(),
            headers: request.headers().clone(),
            key,
        }
    }
}

/// A scheme has no case. Other credentials than a key are none.
fn sent_as(text: &str, page: bool) -> SentKey {
    let behind = |scheme: &str| {
        let (found, rest) = text.split_at_checked(scheme.len())?;
        found.eq_ignore_ascii_case(scheme).then_some(rest)
    };
    match behind(BASIC).filter(|_| page) {
        Some(encoded) => SentKey::Kept(password(encoded).as_deref().map(own).unwrap_or_default()),
        None => SentKey::Chosen(behind(SCHEME).map(own).unwrap_or_default()),
    }
}

fn own(key: &str) -> String {
    match is_key(key) {
        true => key.to_owned(),
        false => String::new(),
    }
}

fn password(encoded: &str) -> Option<String> {
    let text = String::from_utf8(STANDARD.decode(encoded.trim()).ok()?).ok()?;
    text.split_once(':')
        .map(|(_, password)| password.trim().to_owned())
}
