//! Calls that a browser makes for a page of another site. Where no key is asked for, whoever reaches the port may do
//! everything, and a browser on this machine reaches it for every page that it shows.
//!
//! - **Cross-site requests**: a browser says in `Origin` or `Sec-Fetch-Site` that another site's page asks. Programs send
//!   neither.
//! - **DNS rebinding**: a page's own name is made to point to this machine, so the browser takes the service for the page's site.
//!   The name is in `Host`, where a program has `localhost` or an address.

use std::net::IpAddr;
use tonic::codegen::http::header::{HOST, ORIGIN};
use tonic::codegen::http::uri::Authority;
use tonic::codegen::http::{HeaderMap, Method, Uri};
use yoto_proto::v1::ErrorReason;
use yoto_request::RequestError;

const SITE: &str = "sec-fetch-site";

/// Refuses a call of a page of another site. On loopback, the call must name this machine.
///
/// # Errors
/// [`ErrorReason::OtherSite`].
pub(super) fn check(uri: &Uri, headers: &HeaderMap, on_loopback: bool) -> Result<(), RequestError> {
    // All of them: one that a proxy adds doesn't hide another.
    let mut named = Vec::new();
    if let Some(authority) = uri.authority() {
        named.push(authority.as_str());
    }
    for value in headers.get_all(HOST) {
        named.push(value.to_str().unwrap_or_default());
    }
    let own = |name: &&str| is_this_machine(name);
    if on_loopback && !named.iter().all(own) {
        return Err(refused(
            "the name in the request is not this machine's: call the service by localhost or 127.0.0.1, or with a key",
        ));
    }
    let same = |value: &str| {
        let authority = value.split_once("://").map(|(_, rest)| rest);
        authority.is_some_and(|it| named.iter().any(|name| name.eq_ignore_ascii_case(it)))
    };
    let text =
        |value: &tonic::codegen::http::HeaderValue| value.to_str().unwrap_or_default().to_owned();
    let foreign = headers.get_all(ORIGIN).iter().any(|it| !same(&text(it)));
    let site = headers.get(SITE).map(text);
    let asked_here = site.is_none_or(|it| it == "same-origin" || it == "none");
    match foreign || !asked_here {
        true => Err(refused("a page of another site calls the service")),
        false => Ok(()),
    }
}

/// Whether a browser asks for a page to show it by itself, as after a click on a link in another site: that site sees nothing of it,
/// and asking for a page changes nothing.
pub(super) fn shows_page(method: &Method, headers: &HeaderMap) -> bool {
    let says = |name: &str, value: &str| headers.get(name).is_some_and(|it| it == value);
    method == Method::GET
        && says("sec-fetch-mode", "navigate")
        && says("sec-fetch-dest", "document")
        && !headers.contains_key(ORIGIN)
}

fn refused(message: &str) -> RequestError {
    RequestError::refused(ErrorReason::OtherSite, message)
}

/// Whether `authority` is `localhost` or a loopback address, with any port: a tunnel has its own.
fn is_this_machine(authority: &str) -> bool {
    let Ok(authority) = authority.parse::<Authority>() else {
        return false;
    };
    let host = authority
        .host()
        .trim_start_matches('[')
        .trim_end_matches(']');
    let plain = !authority.as_str().contains('@');
    let address = host.parse::<IpAddr>().is_ok_and(|it| it.is_loopback());
    plain && (address || host.eq_ignore_ascii_case("localhost"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(uri: &str, headers: &[(&'static str, &'static str)], on_loopback: bool) -> bool {
        let mut map = HeaderMap::new();
        for (name, value) in headers {
            map.append(*name, value.parse().expect("a value"));
        }
        check(&uri.parse().expect("a URI"), &map, on_loopback).is_ok()
    }

    #[test]
    fn only_names_of_this_machine_are_called() {
        for own in [
            "localhost:50051",
            "127.0.0.1:6000",
            "127.8.9.1",
            "[::1]:1",
            "LOCALHOST",
        ] {
            assert!(asked("/x", &[("host", own)], true), "{own}");
            assert!(asked(&format!("http://{own}/x"), &[], true), "{own}");
        }
        for other in [
            "evil.example",
            "localhost.evil.example:1",
            "127.0.0.1.evil.example",
            "10.0.0.1:1",
            "a@127.0.0.1",
            "",
        ] {
            let host: &'static str = String::leak(other.to_owned());
            assert!(!asked("/x", &[("host", host)], true), "{other}");
            assert!(
                asked("/x", &[("host", host)], false),
                "{other} is a machine of a network"
            );
        }
        assert!(!asked(
            "http://evil.example/x",
            &[("host", "localhost")],
            true
        ));
        // No browser sends none.
        assert!(asked("/x", &[], true));
    }

    #[test]
    fn pages_of_other_sites_call_nothing() {
        let own = ("host", "localhost:50051");
        for on_loopback in [true, false] {
            let sent = |it| asked("/x", &[own, it], on_loopback);
            assert!(sent(("origin", "http://localhost:50051")));
            assert!(!sent(("origin", "http://localhost:3000")));
            assert!(!sent(("origin", "https://evil.example")));
            assert!(!sent(("origin", "null")));
            assert!(sent(("sec-fetch-site", "none")) && sent(("sec-fetch-site", "same-origin")));
            assert!(
                !sent(("sec-fetch-site", "cross-site")) && !sent(("sec-fetch-site", "same-site"))
            );
        }
    }
}
