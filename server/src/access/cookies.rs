//! Cookies: the key of a session, and what is known of somebody who is at the issuer.
//!
//! Scripts can't read them, and a browser sends neither with what another site's page asks for, except when it shows a page of this
//! service by itself, as after a click on a link. Where the page is encrypted, their names begin with `__Host-`, so that no other host of the same
//! domain can set them.

use axum::http::header::{COOKIE, ORIGIN};
use axum::http::{HeaderMap, HeaderValue};
use percent_encoding::{NON_ALPHANUMERIC, percent_decode_str, utf8_percent_encode};
use std::time::Duration;

/// What the name of a cookie begins with that only this host can have set, over TLS.
const OF_HOST: &str = "__Host-";
/// The cookie of a session.
const SESSION: &str = "yoto-session";
/// The cookie of a sign-in that has begun.
const BEGUN: &str = "yoto-sign-in";
/// Time that somebody may take at the issuer.
const AT_ISSUER: Duration = Duration::from_secs(600);

/// What is known of somebody who was sent to the issuer. It stands in the browser, so that any coordinator can go on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Begun {
    /// What the issuer sends back: nobody else's browser has begun this.
    pub state: String,
    /// What the ID token must contain: it was made for this sign-in.
    pub nonce: String,
    /// What proves to the issuer that the code is used by who has begun (PKCE).
    pub verifier: String,
    /// The page that was asked for.
    pub to: String,
}

/// The key of a session.
pub(crate) fn session_of(headers: &HeaderMap) -> Option<String> {
    value(headers, SESSION)
}

/// Begins the session of `key`, for as long as `life`; until the browser is closed without one.
pub(crate) fn session(key: &str, life: Option<Duration>, encrypted: bool) -> Option<HeaderValue> {
    cookie(SESSION, key, life, encrypted)
}

/// Ends the session in the browser.
pub(crate) fn no_session() -> [Option<HeaderValue>; 2] {
    gone(SESSION)
}

impl Begun {
    /// What an earlier answer has told the browser.
    pub(crate) fn of(headers: &HeaderMap) -> Option<Self> {
        let text = value(headers, BEGUN)?;
        let mut parts = text.split('.').map(|part| {
            let text = percent_decode_str(part).decode_utf8();
            text.ok().map(|it| it.into_owned())
        });
        let mut next = || parts.next().flatten();
        Some(Self {
            state: next().filter(|it| !it.is_empty())?,
            nonce: next()?,
            verifier: next()?,
            to: next()?,
        })
    }

    /// Tells the browser.
    pub(crate) fn cookie(&self, encrypted: bool) -> Option<HeaderValue> {
        let parts = [&self.state, &self.nonce, &self.verifier, &self.to];
        let parts = parts.map(|it| utf8_percent_encode(it, NON_ALPHANUMERIC).to_string());
        cookie(BEGUN, &parts.join("."), Some(AT_ISSUER), encrypted)
    }

    /// Has the browser forget it: a code is used once.
    pub(crate) fn over() -> [Option<HeaderValue>; 2] {
        gone(BEGUN)
    }
}

/// Whether the page from which a form comes was encrypted on its way, perhaps by a proxy.
pub(crate) fn is_encrypted(headers: &HeaderMap) -> bool {
    let origin = headers.get(ORIGIN).and_then(|it| it.to_str().ok());
    origin.is_some_and(|it| it.starts_with("https://"))
}

fn value(headers: &HeaderMap, name: &str) -> Option<String> {
    let all = headers.get_all(COOKIE).iter();
    let texts = all.filter_map(|it| it.to_str().ok());
    let pairs = texts
        .flat_map(|it| it.split(';'))
        .filter_map(|it| it.trim().split_once('='));
    let known: Vec<_> = pairs
        .filter(|(found, _)| found.strip_prefix(OF_HOST).unwrap_or(found) == name)
        .collect();
    let of_host = known.iter().find(|it| it.0.starts_with(OF_HOST));
    of_host.or(known.first()).map(|it| it.1.to_owned())
}

/// Has the browser forget a cookie of either name.
fn gone(name: &str) -> [Option<HeaderValue>; 2] {
    [false, true].map(|encrypted| cookie(name, "", Some(Duration::ZERO), encrypted))
}

/// `None` if the value is invalid in a header. Values here are percent-encoded or hexadecimal, and so valid.
fn cookie(name: &str, value: &str, life: Option<Duration>, encrypted: bool) -> Option<HeaderValue> {
    let of_host = if encrypted { OF_HOST } else { "" };
    let mut text = format!("{of_host}{name}={value}; Path=/; HttpOnly; SameSite=Lax");
    if let Some(life) = life {
        text.push_str(&format!("; Max-Age={}", life.as_secs()));
    }
    if encrypted {
        text.push_str("; Secure");
    }
    HeaderValue::from_str(&text).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sent(text: &str) -> HeaderMap {
        let mut headers = HeaderMap::new();
        headers.append(COOKIE, text.parse().expect("a header"));
        headers
    }

    #[test]
    fn a_sign_in_that_has_begun_comes_back_as_it_was() {
        let begun = Begun {
            state: "a-b_c".to_owned(),
            nonce: "n.1".to_owned(),
            verifier: "v~2".to_owned(),
            to: "/models/x?y=ä&z=;".to_owned(),
        };
        let cookie = begun.cookie(true).expect("a header");
        let cookie = cookie.to_str().expect("text");
        let (pair, rest) = cookie.split_once(';').expect("attributes");
        assert_eq!(Begun::of(&sent(&format!("x=1; {pair}; y"))), Some(begun));
        assert!(
            rest.contains("HttpOnly; SameSite=Lax; Max-Age=600; Secure"),
            "{rest}"
        );
        for other in [
            "",
            "yoto-sign-in=",
            "yoto-sign-in=a.b",
            "yoto-sign-in=%FF.b.c.d",
        ] {
            assert_eq!(Begun::of(&sent(other)), None, "{other}");
        }
    }

    #[test]
    fn a_session_is_found_among_cookies() {
        let headers = sent("a=yoto-session; yoto-session=yoto_1 ; yoto-session-2=x");
        assert_eq!(session_of(&headers).as_deref(), Some("yoto_1"));
        assert_eq!(session_of(&sent("session=1")), None);
        let planted = sent("yoto-session=evil; __Host-yoto-session=own");
        assert_eq!(session_of(&planted).as_deref(), Some("own"));
        let cookie = session("k", None, false).expect("a header");
        assert_eq!(cookie, "yoto-session=k; Path=/; HttpOnly; SameSite=Lax");
    }
}
