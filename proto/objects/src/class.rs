//! What a failure of a store means for its caller.
//!
//! The errors of `object_store` keep the answer of a server only in their text: the HTTP status, and the XML body with
//! the code that S3, Google Cloud Storage and Azure give.

use object_store::client::HttpError;
use std::error::Error;

/// Codes of a refusal that only an operator can end.
const REFUSALS: &[&str] = &[
    "AccessDenied",
    "AccountProblem",
    "AllAccessDisabled",
    "AuthorizationHeaderMalformed",
    "ExpiredToken",
    "IllegalLocationConstraintException",
    "InvalidAccessKeyId",
    "InvalidSecurity",
    "InvalidToken",
    "NoSuchBucket",
    "NotSignedUp",
    "PermanentRedirect",
    "RequestTimeTooSkewed",
    "SignatureDoesNotMatch",
    // Azure's.
    "AuthenticationFailed",
    "AuthorizationFailure",
    "AuthorizationPermissionMismatch",
    "ContainerNotFound",
];
/// Codes of a failure that passes. S3 also sends them in the body of a bulk deletion or of the end of an upload in
/// parts, whose status is 200.
const PASSING: &[&str] = &[
    "InternalError",
    "OperationAborted",
    "RequestTimeout",
    "ServerBusy",
    "ServiceUnavailable",
    "SlowDown",
    "SlowDownRead",
    "SlowDownWrite",
];
/// Codes of an object that does not exist.
const NO_OBJECT: &[&str] = &["NoSuchKey", "BlobNotFound"];
/// Before the status in an error of `object_store`'s client.
const STATUS: &str = "non-2xx status code: ";

/// What a failure of a store means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Class {
    /// No object has the key.
    Missing,
    /// The store does not answer, or not now: the same call may succeed later.
    Unavailable,
    /// The store refuses this service until its operator changes something.
    Refused,
    /// Anything else.
    Other,
}

/// The class of an error.
pub(crate) fn of(error: &object_store::Error) -> Class {
    use object_store::Error as E;
    let text = text(error);
    let has = |codes: &[&str]| codes.iter().any(|it| is_code(&text, it));
    if has(REFUSALS) || text.contains("redirect without LOCATION") {
        return Class::Refused;
    }
    match (error, status(&text)) {
        // The body of a HEAD's answer is empty. Another web server in the store's place has one of its own.
        (E::NotFound { .. }, Some(404)) if has(NO_OBJECT) || is_bare(&text) => Class::Missing,
        (E::NotFound { .. }, Some(_)) => Class::Unavailable,
        (E::NotFound { .. }, None) => Class::Missing,
        (E::PermissionDenied { .. } | E::Unauthenticated { .. }, _) => Class::Refused,
        (_, Some(408 | 429 | 500..)) => Class::Unavailable,
        _ if has(PASSING) || is_of_network(error) => Class::Unavailable,
        _ => Class::Other,
    }
}

/// The texts of an error and its causes.
pub(crate) fn text(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let more = error.to_string();
        if !text.contains(&more) {
            text.push_str(": ");
            text.push_str(&more);
        }
        cause = error.source();
    }
    text
}

/// The HTTP status in the text of an error.
pub(crate) fn status(text: &str) -> Option<u16> {
    let (_, rest) = text.split_once(STATUS)?;
    rest.get(..3)?.parse().ok()
}

/// What the XML body in the text of an error has in the element `name`.
pub(crate) fn element<'a>(text: &'a str, name: &str) -> Option<&'a str> {
    let (_, rest) = text.split_once(&format!("<{name}>"))?;
    rest.split_once("</").map(|(inside, _)| inside)
}

/// Whether the answer in this text has the code: in its body, or for an object of a bulk deletion.
fn is_code(text: &str, code: &str) -> bool {
    element(text, "Code") == Some(code) || text.contains(&format!("(code: {code})"))
}

/// Whether the answer in this text has a status and no body.
fn is_bare(text: &str) -> bool {
    let after = text.split_once(STATUS).map_or("", |(_, rest)| rest);
    after
        .split_once(": ")
        .is_none_or(|(_, body)| body.trim().is_empty())
}

/// Whether no answer, or no whole answer, came.
fn is_of_network(error: &object_store::Error) -> bool {
    let mut cause = Error::source(error);
    while let Some(error) = cause {
        if error.is::<HttpError>() {
            return true;
        }
        cause = error.source();
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    fn generic(text: &str) -> object_store::Error {
        object_store::Error::Generic {
            store: "S3",
            source: text.to_owned().into(),
        }
    }

    fn not_found(text: &str) -> object_store::Error {
        object_store::Error::NotFound {
            path: "a".into(),
            source: text.to_owned().into(),
        }
    }

    #[test]
    fn answers_of_stores_are_told_apart() {
        let answer = |status: &str, body: &str| {
            format!(
                "Error performing GET http://s in 1s - Server returned {STATUS}{status}: {body}"
            )
        };
        let code = |code: &str| format!("<Error><Code>{code}</Code></Error>");
        for (error, expected) in [
            (
                generic(&answer("503 Slow Down", &code("SlowDown"))),
                Class::Unavailable,
            ),
            (
                generic(&answer("502 Bad Gateway", "<html>")),
                Class::Unavailable,
            ),
            (
                generic(&answer("429 Too Many Requests", "")),
                Class::Unavailable,
            ),
            (
                generic("DeleteObjects request failed for key a: x (code: SlowDown)"),
                Class::Unavailable,
            ),
            (
                generic("DeleteObjects request failed for key a: x (code: AccessDenied)"),
                Class::Refused,
            ),
            (
                generic(&answer("400 Bad Request", &code("ExpiredToken"))),
                Class::Refused,
            ),
            (
                generic(&answer("400 Bad Request", &code("InvalidRequest"))),
                Class::Other,
            ),
            (
                not_found(&answer("404 Not Found", &code("NoSuchKey"))),
                Class::Missing,
            ),
            (not_found(&answer("404 Not Found", "")), Class::Missing),
            (not_found("no such file"), Class::Missing),
            (
                not_found(&answer("404 Not Found", &code("NoSuchBucket"))),
                Class::Refused,
            ),
            (
                not_found(&answer("404 Not Found", "<html>no such page")),
                Class::Unavailable,
            ),
        ] {
            assert_eq!(of(&error), expected, "{error}");
        }
    }
}
