//! Files that a client reads from a remote object store, and parts of uploads that it writes there, by URLs that the service
//! signs.
//!
//! Such a URL is a secret: no error and no line of a log has it, or what the store answers to it. A store that can't be
//! used is not tried again by the same client, so that who can't reach it loses little time.

mod get;
mod line;
mod put;

use super::tls::Tls;
use hyper::{StatusCode, Uri};
use line::Line;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;
use thiserror::Error;

/// Longest wait until the store accepts a connection. A firewall that drops everything costs this once.
const ACCEPT: Duration = Duration::from_secs(1);
/// Longest wait for the beginning of an answer, with the handshake of TLS.
const BEGIN: Duration = Duration::from_secs(3);
/// Longest wait for the next bytes of an answer.
const SILENCE: Duration = Duration::from_secs(30);

/// Why the store did not send or take bytes. None of it has the URL.
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

/// What a client knows of the store.
#[derive(Debug)]
pub(super) struct Direct {
    /// Whether the store may be used without TLS.
    clear: bool,
    pub(super) reads: Switch,
    pub(super) writes: Switch,
    /// Connections that nobody uses at the moment.
    free: Mutex<Vec<Line>>,
    tls: Mutex<Option<Tls>>,
}

impl Direct {
    /// One that uses a store without TLS only if it may be `clear`.
    pub(super) fn new(clear: bool) -> Self {
        Self {
            clear,
            reads: Switch::new("the object store is not read directly"),
            writes: Switch::new("the object store is not written directly"),
            free: Mutex::default(),
            tls: Mutex::default(),
        }
    }

    /// A connection that was kept and goes to the host of `uri`.
    fn kept(&self, uri: &Uri) -> Option<Line> {
        let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        let at = free.iter().position(|it| it.goes_to(uri))?;
        Some(free.swap_remove(at))
    }

    /// Keeps a connection whose answer was read to its end.
    fn keep(&self, line: Line) {
        let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        free.push(line);
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

/// Whether one use of the store is worth a try.
#[derive(Debug)]
pub(super) struct Switch {
    is_off: AtomicBool,
    /// What it means to be off.
    off: &'static str,
}

impl Switch {
    fn new(off: &'static str) -> Self {
        Self {
            is_off: AtomicBool::default(),
            off,
        }
    }

    /// Whether it is worth a try.
    pub(super) fn is_on(&self) -> bool {
        !self.is_off.load(Ordering::Relaxed)
    }

    /// Leaves everything further to the service, and says why once.
    pub(super) fn give_up(&self, why: &str) {
        if !self.is_off.swap(true, Ordering::Relaxed) {
            tracing::debug!(why, "{}", self.off);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytes::Bytes;
    use std::collections::HashMap;
    use std::net::{Ipv4Addr, TcpListener};

    async fn faults(direct: &Direct, url: &str) -> [Fault; 2] {
        let read = direct.get(url, 0, 9).await;
        let written = direct.put(url, &HashMap::new(), &[Bytes::new()]).await;
        match (read, written) {
            (Err(read), Err(written)) => [read, written],
            _ => panic!("nobody is there"),
        }
    }

    #[tokio::test]
    async fn a_fault_does_not_tell_the_url() {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("a port");
        let address = listener.local_addr().expect("an address");
        drop(listener);
        let secret = "k?X-Amz-Signature=0f";
        let gone = faults(&Direct::new(true), &format!("http://{address}/{secret}")).await;
        assert!(
            gone.iter().all(|it| matches!(it, Fault::Connect(_))),
            "{gone:?}"
        );
        let clear = faults(&Direct::new(false), &format!("http://{address}/{secret}")).await;
        assert!(
            clear.iter().all(|it| matches!(it, Fault::Clear)),
            "{clear:?}"
        );
        let other = faults(&Direct::new(true), &format!("ftp://{address}/{secret}")).await;
        assert!(other.iter().all(|it| matches!(it, Fault::Url)), "{other:?}");
        let bad = faults(&Direct::new(true), "no url X-Amz-Signature=0f").await;
        for fault in [gone, clear, other, bad].as_flattened() {
            let told = format!("{fault} {fault:?}");
            assert!(!told.contains("0f"), "{told}");
        }
    }
}
