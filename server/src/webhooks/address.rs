//! Where an address of a webhook leads: a caller must not make the service ask what only the service can reach.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use thiserror::Error;
use url::{Host, Url};

/// Longest address, bytes.
const LONGEST: usize = 2048;

/// Why an address is not used.
#[derive(Debug, Error, PartialEq, Eq)]
pub(crate) enum AddressError {
    #[error("{0}")]
    Url(String),
    #[error("{0} can't be found: {1}")]
    Unknown(String, String),
    #[error(
        "{0} leads to {1}, which is of this machine or of a private network (`--private-webhooks` of `yoto serve` allows it)"
    )]
    Private(String, IpAddr),
}

/// The address in `text`, as far as it can be checked without asking for the host's addresses.
///
/// # Errors
/// Why it is none that is told anything.
pub(crate) fn check_url(text: &str, private: bool) -> Result<Url, AddressError> {
    let wrong = |message: &str| AddressError::Url(message.to_owned());
    if text.len() > LONGEST {
        return Err(wrong("is longer than 2048 bytes"));
    }
    let url = Url::parse(text).map_err(|error| AddressError::Url(format!("is no URL: {error}")))?;
    match url.scheme() {
        "https" => {}
        "http" if private => {}
        _ => return Err(wrong("begins with something else than https://")),
    }
    if !url.username().is_empty() || url.password().is_some() {
        return Err(wrong(
            "has a user name or a password: the signature tells who asks",
        ));
    }
    let ip = match url.host() {
        Some(Host::Ipv4(ip)) => IpAddr::V4(ip),
        Some(Host::Ipv6(ip)) => IpAddr::V6(ip),
        Some(Host::Domain(_)) => return Ok(url),
        None => return Err(wrong("has no host")),
    };
    match private || is_public(ip) {
        true => Ok(url),
        false => Err(AddressError::Private(ip.to_string(), ip)),
    }
}

/// The addresses of the host of `url`, all of which may be asked.
///
/// # Errors
/// When there is none, or one of this machine or of a private network and not `private`.
pub(super) async fn resolved(url: &Url, private: bool) -> Result<Vec<SocketAddr>, AddressError> {
    let host = url.host_str().unwrap_or_default().trim_matches(['[', ']']);
    let unknown = |error: String| AddressError::Unknown(host.to_owned(), error);
    let port = url.port_or_known_default().unwrap_or(443);
    let found = tokio::net::lookup_host((host, port)).await;
    let found: Vec<SocketAddr> = found.map_err(|error| unknown(error.to_string()))?.collect();
    if found.is_empty() {
        return Err(unknown("it has no address".to_owned()));
    }
    let inside = found.iter().find(|it| !private && !is_public(it.ip()));
    match inside {
        Some(inside) => Err(AddressError::Private(host.to_owned(), inside.ip())),
        None => Ok(found),
    }
}

/// Whether everybody on the internet reaches the same under `ip` (IANA's registries of special-purpose addresses).
fn is_public(ip: IpAddr) -> bool {
    match ip {
        IpAddr::V4(ip) => is_public_v4(ip),
        IpAddr::V6(ip) => match ip.to_ipv4_mapped() {
            Some(ip) => is_public_v4(ip),
            None => is_public_v6(ip),
        },
    }
}

fn is_public_v4(ip: Ipv4Addr) -> bool {
    let [a, b, c, _] = ip.octets();
    let special = ip.is_private()
        || ip.is_loopback()
        || ip.is_link_local()
        || ip.is_documentation()
        || a == 0
        // Shared address space, IETF protocol assignments, benchmarking; multicast and reserved.
        || (a == 100 && (64..128).contains(&b))
        || (a == 192 && b == 0 && c == 0)
        // The relays of 6to4, which RFC 7526 has ended.
        || (a == 192 && b == 88 && c == 99)
        || (a == 198 && (b == 18 || b == 19))
        || a >= 224;
    !special
}

fn is_public_v6(ip: Ipv6Addr) -> bool {
    let [first, second, ..] = ip.segments();
    // 2000::/3 alone is given out; in it are IETF protocol assignments, documentation, and 6to4, which has an IPv4 address inside.
    (0x2000..0x4000).contains(&first)
        && !(first == 0x2001 && second < 0x0200)
        && !(first == 0x2001 && second == 0x0db8)
        && first != 0x2002
        && !(first == 0x3fff && second < 0x1000)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_everybody_reaches_is_public() {
        let public = [
            "93.184.216.34",
            "100.128.0.1",
            "2606:2800:220:1::1",
            "::ffff:8.8.8.8",
        ];
        let special = [
            "127.0.0.1",
            "10.1.2.3",
            "172.16.0.1",
            "192.168.1.1",
            "169.254.169.254",
            "100.64.0.1",
            "0.0.0.0",
            "192.0.0.1",
            "192.88.99.1",
            "198.18.0.1",
            "224.0.0.1",
            "255.255.255.255",
            "203.0.113.1",
            "::1",
            "::",
            "fe80::1",
            "fd00::1",
            "::ffff:127.0.0.1",
            "64:ff9b::7f00:1",
            "2002:7f00:1::",
            "2001:db8::1",
            "2001::1",
            "ff02::1",
        ];
        for ip in public {
            assert!(is_public(ip.parse().expect(ip)), "{ip}");
        }
        for ip in special {
            assert!(!is_public(ip.parse().expect(ip)), "{ip}");
        }
    }

    #[test]
    fn addresses_that_lead_inside_are_refused() {
        for text in [
            "http://example.org/x",
            "ftp://example.org",
            "https://user:secret@example.org",
            "https://127.0.0.1/x",
            "https://[::1]/x",
            "https://2130706433/x",
            "https://0x7f.1/x",
            "no address",
        ] {
            assert!(check_url(text, false).is_err(), "{text}");
        }
        assert!(check_url("https://example.org/hook?x=1", false).is_ok());
        assert!(check_url("http://127.0.0.1:9/x", true).is_ok());
        let long = format!("https://example.org/{}", "x".repeat(LONGEST));
        assert!(check_url(&long, false).is_err());
    }

    #[tokio::test]
    async fn a_name_is_refused_by_its_addresses() {
        let url = Url::parse("https://localhost/x").expect("a URL");
        let refused = resolved(&url, false).await.expect_err("is this machine");
        assert!(matches!(refused, AddressError::Private(..)), "{refused}");
        assert!(resolved(&url, true).await.is_ok_and(|it| !it.is_empty()));
    }
}
