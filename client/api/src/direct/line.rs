//! Connections to the store.

use super::{ACCEPT, BEGIN, Direct, Fault};
use crate::addresses::Wire;
use bytes::Bytes;
use http_body_util::combinators::UnsyncBoxBody;
use hyper::client::conn::http1::{SendRequest, handshake};
use hyper::header::HOST;
use hyper::{Method, Request, Uri, http};
use hyper_util::rt::TokioIo;
use std::convert::Infallible;
use tokio::net::TcpStream;
use tokio::time::timeout;
use tokio_util::either::Either;

/// What is sent with a request.
pub(super) type Body = UnsyncBoxBody<Bytes, Infallible>;

/// A connection to the store.
#[derive(Debug)]
pub(super) struct Line {
    /// Scheme, host and port.
    origin: String,
    pub(super) sender: SendRequest<Body>,
}

impl Line {
    pub(super) fn goes_to(&self, uri: &Uri) -> bool {
        self.origin == origin(uri)
    }
}

impl Direct {
    /// A new connection to the host of `uri`.
    pub(super) async fn open(&self, uri: &Uri) -> Result<Line, Fault> {
        let wire = self.dial(uri).await?;
        let begun = async {
            let encrypted = self.encrypt(uri, wire).await?;
            let (sender, connection) = handshake(TokioIo::new(encrypted)).await?;
            // Its failure is that of the request as well.
            tokio::spawn(connection);
            Ok(Line {
                origin: origin(uri),
                sender,
            })
        };
        timeout(BEGIN, begun).await.map_err(|_| Fault::Silent)?
    }

    async fn dial(&self, uri: &Uri) -> Result<TcpStream, Fault> {
        let port = match uri.scheme_str() {
            Some("https") => 443,
            Some("http") if self.clear => 80,
            Some("http") => return Err(Fault::Clear),
            _ => return Err(Fault::Url),
        };
        let address = (host(uri)?, uri.port_u16().unwrap_or(port));
        let connected = timeout(ACCEPT, TcpStream::connect(address)).await;
        let connected = connected.map_err(|_| Fault::Silent)?;
        let connected = connected.map_err(Fault::Connect)?;
        connected.set_nodelay(true).map_err(Fault::Connect)?;
        Ok(connected)
    }

    /// The connection with TLS where the URL says so, to a host that the system trusts.
    async fn encrypt(&self, uri: &Uri, connection: TcpStream) -> Result<Wire, Fault> {
        if uri.scheme_str() == Some("http") {
            return Ok(Either::Left(connection));
        }
        let tls = self.tls().map_err(Fault::Connect)?;
        let encrypted = tls.connect(host(uri)?, connection).await;
        Ok(Either::Right(Box::new(encrypted.map_err(Fault::Connect)?)))
    }
}

/// A request for what the URL names.
pub(super) fn request(method: Method, uri: &Uri) -> http::request::Builder {
    let path = uri.path_and_query().map_or("/", |it| it.as_str());
    let authority = uri.authority().map_or("", |it| it.as_str());
    Request::builder()
        .method(method)
        .uri(path)
        .header(HOST, authority)
}

fn origin(uri: &Uri) -> String {
    let scheme = uri.scheme_str().unwrap_or_default();
    let authority = uri.authority().map_or("", |it| it.as_str());
    format!("{scheme}://{authority}")
}

/// The host, without the brackets of IPv6, which belong to the URL.
fn host(uri: &Uri) -> Result<&str, Fault> {
    let host = uri.host().ok_or(Fault::Url)?;
    Ok(host.trim_start_matches('[').trim_end_matches(']'))
}
