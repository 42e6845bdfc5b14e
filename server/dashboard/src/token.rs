//! Forms that another site can't send: each has a token, which only pages of this service contain.
//!
//! A browser sends another site's form to this service, but shows that site none of our pages, so that it can't
//! know the token. The token comes from the id of the object store, a random number in the database: it is the same on all
//! coordinators, and after a restart.

use super::page_error::PageError;
use super::query::Fields;
use axum::body::{Body, to_bytes};
use axum::http::header::CONTENT_TYPE;
use axum::http::{HeaderMap, StatusCode};
use yoto_proto::sha256_hex;
use yoto_store::Tenant;

/// The field of a form with the token.
pub(crate) const FIELD: &str = "token";
/// The header of a script's request with the token.
pub(crate) const HEADER: &str = "x-yoto-token";
/// Maximum length of a form, bytes.
const LONGEST: usize = 64 << 10;
/// What a browser says of the site that sends a form.
const SITE: &str = "sec-fetch-site";

/// The token of the forms of `tenant`, with the id of the object store.
pub(crate) fn of(store_id: &str, tenant: &Tenant) -> String {
    sha256_hex(format!("form\0{store_id}\0{tenant}").as_bytes())
}

/// Lets a request pass that a script of one of our own pages makes, with the token in [`HEADER`]. Another site's page does not know the
/// token, and a browser sends such a header for it only after it has asked this service, which never agrees.
///
/// # Errors
/// When it has no token, or the browser says that another site sends it.
pub(crate) fn checked_of_script(token: &str, headers: &HeaderMap) -> Result<(), PageError> {
    let refused = |words: &str| Err(PageError::of(StatusCode::FORBIDDEN, words));
    if is_of_other_site(headers) {
        return refused("another site's page has sent this");
    }
    let sent = headers.get(HEADER).map_or(&b""[..], |it| it.as_bytes());
    if !is_same(sent, token) {
        return refused("this has no token of this service: reload the page and try again");
    }
    Ok(())
}

/// Whether the browser says that another site's page has sent a request.
fn is_of_other_site(headers: &HeaderMap) -> bool {
    headers.get(SITE).is_some_and(|it| it != "same-origin")
}

/// Whether `sent` is the token. Digests are compared: the time of it tells nothing that would help to guess the token.
fn is_same(sent: &[u8], token: &str) -> bool {
    sha256_hex(sent) == sha256_hex(token.as_bytes())
}

/// The fields of a form that one of our own pages has sent.
///
/// # Errors
/// When it is none, has no token, or the browser says that another site sends it.
pub(crate) async fn checked(
    token: &str,
    headers: &HeaderMap,
    body: Body,
) -> Result<Fields, PageError> {
    let refused = |words: &str| Err(PageError::of(StatusCode::FORBIDDEN, words));
    let is_form = headers.get(CONTENT_TYPE).is_some_and(|kind| {
        kind.as_bytes()
            .starts_with(b"application/x-www-form-urlencoded")
    });
    if !is_form {
        return refused("only a form of this page can ask for this");
    }
    if is_of_other_site(headers) {
        return refused("another site's page has sent this form");
    }
    let Ok(body) = to_bytes(body, LONGEST).await else {
        return refused("the form is too long, or broke off");
    };
    let fields = Fields::read(&body);
    if !is_same(fields.get(FIELD).as_bytes(), token) {
        return refused(
            "the form has no token of this service: go back, reload the page and try again",
        );
    }
    Ok(fields)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FORM: &str = "application/x-www-form-urlencoded";

    async fn sent(headers: &[(&'static str, &'static str)], body: &'static str) -> bool {
        let mut map = HeaderMap::new();
        for (name, value) in headers {
            map.insert(*name, value.parse().expect("a value"));
        }
        checked("t", &map, Body::from(body)).await.is_ok()
    }

    #[tokio::test]
    async fn only_forms_of_our_own_pages_pass() {
        assert!(sent(&[("content-type", FORM)], "token=t").await);
        let same = ("sec-fetch-site", "same-origin");
        assert!(sent(&[("content-type", FORM), same], "token=t").await);
        for (headers, body) in [
            (vec![("content-type", FORM)], "token=x"),
            (vec![("content-type", FORM)], ""),
            (vec![("content-type", "text/plain")], "token=t"),
            (vec![], "token=t"),
            (
                vec![("content-type", FORM), ("sec-fetch-site", "cross-site")],
                "token=t",
            ),
            (
                vec![("content-type", FORM), ("sec-fetch-site", "none")],
                "token=t",
            ),
        ] {
            assert!(!sent(&headers, body).await, "{headers:?} {body}");
        }
    }

    #[test]
    fn only_scripts_of_our_own_pages_pass() {
        let sent = |headers: &[(&'static str, &'static str)]| {
            let all = headers.iter().map(|(name, value)| {
                let name = axum::http::HeaderName::from_static(name);
                (name, axum::http::HeaderValue::from_static(value))
            });
            checked_of_script("t", &all.collect()).is_ok()
        };
        assert!(sent(&[(HEADER, "t")]));
        assert!(sent(&[(HEADER, "t"), (SITE, "same-origin")]));
        assert!(!sent(&[]) && !sent(&[(HEADER, "")]) && !sent(&[(HEADER, "x")]));
        for site in ["cross-site", "same-site", "none"] {
            assert!(!sent(&[(HEADER, "t"), (SITE, site)]), "{site}");
        }
    }

    #[test]
    fn tenants_have_tokens_of_their_own() {
        let other = Tenant::new("other").expect("an id");
        assert_ne!(of("a", &Tenant::default()), of("a", &other));
        assert_ne!(of("a", &other), of("b", &other));
    }
}
