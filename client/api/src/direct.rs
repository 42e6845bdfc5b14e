//! Files that a remote object store sends by itself, by URLs that the service signs.
//!
//! Such a URL is a secret: no error and no line of a log has it, or what the store answers to it. A store that can't be
//! read is not tried again by the same client, so that who can't reach it loses little time.

use super::addresses::Wire;
use super::tls::Tls;
use bytes::Bytes;
use http_body_util::{BodyExt, Empty};
use hyper::body::Incoming;
use hyper::client::conn::http1::{SendRequest, handshake};
use hyper::header::{CONTENT_RANGE, HOST, RANGE};
use hyper::{Request, StatusCode, Uri};
use hyper_util::rt::TokioIo;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;
use thiserror::Error;
use tokio::net::TcpStream;
use tokio::time::timeout;
use tokio_util::either::Either;

/// Longest wait until the store accepts a connection. A firewall that drops everything costs this once.
const ACCEPT: Duration = Duration::from_secs(1);
/// Longest wait for the beginning of an answer, with the handshake of TLS.
const BEGIN: Duration = Duration::from_secs(3);
/// Longest wait for the next bytes of an answer.
const SILENCE: Duration = Duration::from_secs(30);

/// Why the store did not send a file. None of it has the URL.
#[derive(Debug, Error)]
pub(super) enum Fault {
    #[error("its URL is not one of HTTP")]
    Url,
    #[error("it is not encrypted, and the service is")]
    Clear,
    #[error("it can't be reached: {0}")]
    Connect(io::Error),
    #[error("it does not answer in time")]
    Silent,
    #[error("it answers with status {}", .0.as_u16())]
    Status(StatusCode),
    #[error("the size of its file differs")]
    Size,
    #[error("its file was altered")]
    Altered,
    #[error("the connection broke: {0}")]
    Broken(#[from] hyper::Error),
}

/// A connection to the store.
#[derive(Debug)]
struct Line {
    /// Scheme, host and port.
    origin: String,
    sender: SendRequest<Empty<Bytes>>,
}

/// What a client knows of the store.
#[derive(Debug, Default)]
pub(super) struct Direct {
    /// Whether files may come without TLS.
    clear: bool,
    is_off: AtomicBool,
    /// The last connection, while nobody uses it.
    free: Mutex<Option<Line>>,
    tls: Mutex<Option<Tls>>,
}

impl Direct {
    /// One whose files may come without TLS.
    pub(super) fn clear() -> Self {
        Self {
            clear: true,
            ..Self::default()
        }
    }

    /// Whether the store is worth a try.
    pub(super) fn is_on(&self) -> bool {
        !self.is_off.load(Ordering::Relaxed)
    }

    /// Has all further files come through the service, and says why once.
    pub(super) fn give_up(&self, why: &str) {
        if !self.is_off.swap(true, Ordering::Relaxed) {
            tracing::debug!(why, "the object store is not read directly");
        }
    }

    /// Asks for the file of `bytes` at `url`, from the byte `from` on, which the file has.
    pub(super) async fn get(&self, url: &str, from: u64, bytes: u64) -> Result<Answer, Fault> {
        let uri: Uri = url.parse().map_err(|_| Fault::Url)?;
        let range = (from, bytes);
        if let Some(line) = self.kept(&uri)
            // It may have ended meanwhile.
            && let Ok(Ok(answer)) = timeout(BEGIN, ask(line, &uri, range)).await
        {
            return Ok(answer);
        }
        let wire = self.dial(&uri).await?;
        let begun = async {
            let encrypted = self.encrypt(&uri, wire).await?;
            let (sender, connection) = handshake(TokioIo::new(encrypted)).await?;
            // Its failure is that of the request as well.
            tokio::spawn(connection);
            let origin = origin(&uri);
            ask(Line { origin, sender }, &uri, range).await
        };
        timeout(BEGIN, begun).await.map_err(|_| Fault::Silent)?
    }

    /// The connection that was kept, if it goes to the host of `uri`.
    fn kept(&self, uri: &Uri) -> Option<Line> {
        let line = self.free.lock();
        let line = line.unwrap_or_else(PoisonError::into_inner).take();
        line.filter(|it| it.origin == origin(uri))
    }

    /// Keeps the connection of an answer that was read to its end.
    pub(super) fn keep(&self, answer: Answer) {
        let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        *free = Some(answer.line);
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

    /// The authorities of the system, read once.
    fn tls(&self) -> io::Result<Tls> {
        let mut known = self.tls.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(tls) = &*known {
            return Ok(tls.clone());
        }
        let tls = Tls::http1().map_err(io::Error::other)?;
        Ok(known.insert(tls).clone())
    }
}

/// A file that the store sends.
pub(super) struct Answer {
    line: Line,
    body: Incoming,
}

impl Answer {
    /// The next bytes; `None` at the end.
    pub(super) async fn chunk(&mut self) -> Result<Option<Bytes>, Fault> {
        loop {
            let frame = timeout(SILENCE, self.body.frame()).await;
            let Some(frame) = frame.map_err(|_| Fault::Silent)? else {
                return Ok(None);
            };
            // What is no data are trailers.
            if let Ok(chunk) = frame?.into_data() {
                return Ok(Some(chunk));
            }
        }
    }
}

/// Sends the request for a file of `bytes`, from the byte `from` on, and looks at the head of the answer.
async fn ask(mut line: Line, uri: &Uri, (from, bytes): (u64, u64)) -> Result<Answer, Fault> {
    let path = uri.path_and_query().map_or("/", |it| it.as_str());
    let authority = uri.authority().map_or("", |it| it.as_str());
    let request = Request::get(path)
        .header(HOST, authority)
        .header(RANGE, format!("bytes={from}-"))
        .body(Empty::new())
        .map_err(|_| Fault::Url)?;
    line.sender.ready().await?;
    let (head, body) = line.sender.send_request(request).await?.into_parts();
    if head.status != StatusCode::PARTIAL_CONTENT {
        return Err(Fault::Status(head.status));
    }
    let expected = format!("bytes {from}-{}/{bytes}", bytes.saturating_sub(1));
    let sent = head.headers.get(CONTENT_RANGE);
    match sent.is_some_and(|it| it.as_bytes() == expected.as_bytes()) {
        true => Ok(Answer { line, body }),
        false => Err(Fault::Size),
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::{Ipv4Addr, TcpListener};

    async fn fault(direct: &Direct, url: &str) -> Fault {
        match direct.get(url, 0, 9).await {
            Ok(_) => panic!("nobody is there"),
            Err(fault) => fault,
        }
    }

    #[tokio::test]
    async fn a_fault_does_not_tell_the_url() {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("a port");
        let address = listener.local_addr().expect("an address");
        drop(listener);
        let secret = "k?X-Amz-Signature=0f";
        let gone = fault(&Direct::clear(), &format!("http://{address}/{secret}")).await;
        assert!(matches!(gone, Fault::Connect(_)), "{gone}");
        let clear = fault(&Direct::default(), &format!("http://{address}/{secret}")).await;
        assert!(matches!(clear, Fault::Clear), "{clear}");
        let other = fault(&Direct::clear(), &format!("ftp://{address}/{secret}")).await;
        assert!(matches!(other, Fault::Url), "{other}");
        let bad = fault(&Direct::clear(), "no url X-Amz-Signature=0f").await;
        for fault in [gone, clear, other, bad] {
            let told = format!("{fault} {fault:?}");
            assert!(!told.contains("0f"), "{told}");
        }
    }
}
