//! Requests to the store, over pooled connections.

use super::{Direct, DirectError};
use crate::tls::system_config;
use bytes::Bytes;
use http_body_util::combinators::UnsyncBoxBody;
use hyper::body::Incoming;
use hyper::http::Extensions;
use hyper::{Request, Response, Uri};
use hyper_rustls::{HttpsConnector, HttpsConnectorBuilder};
use hyper_timeout::TimeoutConnector;
use hyper_util::client::legacy::Client;
use hyper_util::client::legacy::connect::{
    CaptureConnection, HttpConnector, HttpInfo, capture_connection,
};
use hyper_util::rt::{TokioExecutor, TokioTimer};
use std::convert::Infallible;
use std::net::SocketAddr;
use std::sync::PoisonError;
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

    /// Sends a request that changes nothing the second time, and returns the beginning of its answer. The request is made
    /// again after a kept connection broke: the store may have ended it meanwhile.
    pub(super) async fn send(
        &self,
        request: impl Fn() -> Result<Request<RequestBody>, DirectError>,
    ) -> Result<Response<Incoming>, DirectError> {
        loop {
            let mut request = request()?;
            let connection = capture_connection(&mut request);
            let answer = self.http()?.request(request).await;
            let local = local_address(&connection);
            let mut used = self.used.lock().unwrap_or_else(PoisonError::into_inner);
            match answer {
                Ok(answer) if answer.status().is_success() => {
                    used.extend(local);
                    return Ok(answer);
                }
                Ok(answer) => {
                    // The text of a refusal is not read, so its connection can't be used again.
                    if let Some(connection) = &*connection.connection_metadata() {
                        connection.poison();
                    }
                    return Err(DirectError::Status(answer.status()));
                }
                Err(error) if error.is_connect() => return Err(DirectError::Connect(error)),
                Err(_) if local.is_some_and(|it| used.remove(&it)) => {}
                Err(error) => return Err(DirectError::Request(error)),
            }
        }
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

/// The address at this end of the connection that a request has.
fn local_address(connection: &CaptureConnection) -> Option<SocketAddr> {
    let mut extras = Extensions::new();
    let connection = connection.connection_metadata();
    connection.as_ref()?.get_extras(&mut extras);
    extras.get::<HttpInfo>().map(HttpInfo::local_addr)
}
