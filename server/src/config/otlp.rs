//! Where the collector is, and how often it hears from the coordinator.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;
use thiserror::Error;
use tonic::metadata::{AsciiMetadataKey, AsciiMetadataValue, MetadataMap};
use url::Url;

/// Settings of the push by OTLP.
#[derive(Debug, Clone)]
pub struct OtlpConfig {
    /// The collector.
    pub endpoint: OtlpEndpoint,
    /// Sent with each call, such as a key of the collector.
    pub headers: OtlpHeaders,
    /// Time between two calls; above 0.
    pub interval: Duration,
}

impl OtlpConfig {
    /// The collector at `endpoint`, every 15 seconds.
    pub fn new(endpoint: OtlpEndpoint) -> Self {
        Self {
            endpoint,
            headers: OtlpHeaders::default(),
            interval: Duration::from_secs(15),
        }
    }
}

/// The reason why a setting of OTLP can't be used. It never has the value of a header.
#[derive(Debug, Error)]
pub enum OtlpError {
    /// The address is invalid.
    #[error(
        "{0}; an endpoint of OTLP over gRPC is http://HOST:PORT or https://HOST:PORT, and its port is mostly 4317"
    )]
    Endpoint(String),
    /// A header is invalid.
    #[error(
        "header {number}: {fault}; headers are NAME=VALUE with commas between them, and values are percent-encoded"
    )]
    Header {
        /// Its number in the list, from 1.
        number: usize,
        /// Why.
        fault: &'static str,
    },
    /// TLS can't be used.
    #[error("TLS to the collector: {0}")]
    Tls(#[from] rustls::Error),
}

/// The address of a collector, `http://HOST:PORT` or `https://HOST:PORT`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OtlpEndpoint(Url);

impl OtlpEndpoint {
    /// As a URL, which has a host.
    pub(crate) fn url(&self) -> &Url {
        &self.0
    }
}

impl fmt::Display for OtlpEndpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl FromStr for OtlpEndpoint {
    type Err = OtlpError;

    fn from_str(text: &str) -> Result<Self, OtlpError> {
        let fault = |told: &str| Err(OtlpError::Endpoint(told.to_owned()));
        let url = match Url::parse(text) {
            Ok(url) => url,
            Err(error) => return fault(&error.to_string()),
        };
        // `collector:4317` has the scheme `collector`.
        if !["http", "https"].contains(&url.scheme()) {
            return fault("it begins with neither http:// nor https://");
        }
        if !url.username().is_empty() || url.password().is_some() {
            return fault(
                "it has a name or a password: they belong into OTEL_EXPORTER_OTLP_HEADERS",
            );
        }
        if url.path() != "/" || url.query().is_some() || url.fragment().is_some() {
            return fault("it has a path, which only OTLP over HTTP has");
        }
        Ok(Self(url))
    }
}

/// Headers of each call. Their values are secret.
#[derive(Clone, Default)]
pub struct OtlpHeaders(MetadataMap);

impl OtlpHeaders {
    /// The headers.
    pub(crate) fn metadata(&self) -> &MetadataMap {
        &self.0
    }
}

impl fmt::Debug for OtlpHeaders {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = self.0.as_ref().keys();
        f.debug_tuple("OtlpHeaders")
            .field(&names.map(|it| it.as_str()).collect::<Vec<_>>())
            .finish()
    }
}

impl FromStr for OtlpHeaders {
    type Err = OtlpError;

    /// Reads `NAME=VALUE,NAME=VALUE` with percent-encoded values, the form of `OTEL_EXPORTER_OTLP_HEADERS`.
    fn from_str(text: &str) -> Result<Self, OtlpError> {
        let mut headers = MetadataMap::new();
        for (i, entry) in text.split(',').enumerate() {
            if entry.trim().is_empty() {
                continue;
            }
            let fault = |fault| OtlpError::Header {
                number: i + 1,
                fault,
            };
            let (name, value) = entry.split_once('=').ok_or(fault("it has no ="))?;
            let name = name.trim().to_ascii_lowercase();
            let name = AsciiMetadataKey::from_bytes(name.as_bytes());
            let name = name.map_err(|_| fault("its name is not valid for a header"))?;
            let value = percent_encoding::percent_decode_str(value.trim()).collect::<Vec<u8>>();
            let value = AsciiMetadataValue::try_from(value.as_slice());
            let mut value = value.map_err(|_| fault("its value has a control character"))?;
            value.set_sensitive(true);
            headers.insert(name, value);
        }
        Ok(Self(headers))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_endpoint_is_a_host_without_a_path() {
        for good in [
            "http://127.0.0.1:4317",
            "https://otlp.example/",
            "http://[::1]:4317",
        ] {
            good.parse::<OtlpEndpoint>().expect(good);
        }
        for (bad, told) in [
            ("", "relative URL"),
            ("collector:4317", "neither http://"),
            ("http://a:4318/v1/metrics", "it has a path"),
            ("http://a:b@c", "OTEL_EXPORTER_OTLP_HEADERS"),
        ] {
            let error = bad.parse::<OtlpEndpoint>().expect_err(bad).to_string();
            assert!(error.contains(told) && error.contains("4317"), "{error}");
        }
    }

    #[test]
    fn headers_are_decoded_and_their_values_never_shown() {
        let headers: OtlpHeaders = "Authorization=Bearer%20s3cret, x-team = a=b ,,"
            .parse()
            .expect("reads");
        let value = |name: &str| headers.0.get(name).and_then(|it| it.to_str().ok());
        assert_eq!(value("authorization"), Some("Bearer s3cret"));
        assert_eq!(value("x-team"), Some("a=b"));
        let shown = format!("{headers:?} {:?}", headers.0);
        assert!(
            shown.contains("authorization") && !shown.contains("s3cret"),
            "{shown}"
        );
        for bad in ["a=1,s3cret", "a b=s3cret", "k-bin=s3cret", "a=s3cret%0A"] {
            let error = bad.parse::<OtlpHeaders>().expect_err(bad).to_string();
            assert!(!error.contains("s3cret"), "{error}");
        }
    }
}
