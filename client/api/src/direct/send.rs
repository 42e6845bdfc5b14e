//! Requests to the store, over pooled connections.

use super::{Direct, DirectError};
use crate::tls::system_config;
use bytes::Bytes;
use http_body_util::combinators::UnsyncBoxBody;
use hyper::body::Incoming;
use hyper::{Request, Response, Uri};
use hyper_rustls::{HttpsConnector, HttpsConnectorBuilder};
use hyper_timeout::TimeoutConnector;
use hyper_util::client::legacy::Client;
use hyper_util::client::legacy::connect::{HttpConnector, capture_connection};
use hyper_util::rt::{TokioExecutor, TokioTimer};
use std::convert::Infallible;
use std::time::Duration;

/// Longest wait until the store accepts a connection. A firewall that drops everything costs this once.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(1);
/// Longest wait for the beginning of an answer, on a new connection with its handshake of TLS.
pub(super) const HEADER_TIMEOUT: Duration = Duration::from_secs(4);
/// Longest time that an unused connection is kept. Routers forget connections after some minutes, and tell nobody.
const IDLE_TIMEOUT: Duration = Duration::from_secs(30);

/// The client of HTTP/1.1 that keeps connections.
pub(super) type Http = Client<TimeoutConnector<HttpsConnector<HttpConnector>>, RequestBody>;
pub(super) type RequestBody = UnsyncBoxBody<Bytes, Infallible>;

impl Direct {
    /// Parses a signed URL of a store that may be used.
    pub(super) fn parse(&self, url: &str) -> Result<Uri, DirectError> {
        let uri: Uri = url.parse().map_err(|_| DirectError::Url)?;
        match uri.scheme_str() {
            Some("http") if !self.allows_plaintext => Err(DirectError::Plaintext),
            Some("https" | "http") => Ok(uri),
            _ => Err(DirectError::Url),
        }
    }

    /// Sends a request that changes nothing the second time, and returns the beginning of its answer. It is made anew after
    /// a connection that broke: the store may have ended a kept one meanwhile.
    pub(super) async fn send(
        &self,
        request: impl Fn() -> Result<Request<RequestBody>, DirectError>,
    ) -> Result<Response<Incoming>, DirectError> {
        match self.send_once(request()?).await {
            Err(DirectError::Request(_)) => self.send_once(request()?).await,
            sent => sent,
        }
    }

    async fn send_once(
        &self,
        mut request: Request<RequestBody>,
    ) -> Result<Response<Incoming>, DirectError> {
        let connection = capture_connection(&mut request);
        let answer = self.http()?.request(request).await;
        let answer = answer.map_err(|error| match error.is_connect() {
            true => DirectError::Connect(error),
            false => DirectError::Request(error),
        })?;
        if !answer.status().is_success() {
            // What the store says about it is not read, so the connection can't be used again.
            if let Some(connection) = &*connection.connection_metadata() {
                connection.poison();
            }
            return Err(DirectError::Status(answer.status()));
        }
        Ok(answer)
    }

    fn http(&self) -> Result<&Http, DirectError> {
        if let Some(http) = self.http.get() {
            return Ok(http);
        }
        let tls = system_config().map_err(|error| DirectError::Tls(error.to_string()))?;
        let mut tcp = HttpConnector::new();
        tcp.set_connect_timeout(Some(CONNECT_TIMEOUT));
        tcp.set_nodelay(true);
        tcp.enforce_http(false);
        let https = HttpsConnectorBuilder::new().with_tls_config(tls);
        let https = match self.allows_plaintext {
            true => https.https_or_http(),
            false => https.https_only(),
        };
        let mut connector = TimeoutConnector::new(https.enable_http1().wrap_connector(tcp));
        connector.set_connect_timeout(Some(HEADER_TIMEOUT));
        let http = Client::builder(TokioExecutor::new())
            .pool_timer(TokioTimer::new())
            .pool_idle_timeout(IDLE_TIMEOUT)
            .build(connector);
        Ok(self.http.get_or_init(|| http))
    }
}
