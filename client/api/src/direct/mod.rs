//! Files that a client reads from a remote object store, and parts of uploads that it writes there, by URLs that the service
//! signs.
//!
//! Such a URL is a secret: no error and no line of a log has it, or what the store answers to it. A store that can't be
//! used is not tried again by the same client, so that a client that can't reach it loses little time.

mod get;
mod put;
mod send;

use hyper::StatusCode;
use hyper_util::client::legacy;
use send::Http;
use std::collections::HashSet;
use std::error::Error;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock};
use thiserror::Error;

/// Why the store did not send or take bytes. None of it has the URL.
#[derive(Debug, Error)]
pub(super) enum DirectError {
    #[error("its URL is not one of HTTP")]
    Url,
    #[error("it is not encrypted, and the service is")]
    Plaintext,
    #[error("TLS can't be set up: {0}")]
    Tls(String),
    #[error("it can't be reached: {}", root_cause(.0))]
    Connect(legacy::Error),
    #[error("it does not answer in time")]
    Timeout,
    #[error("the connection broke: {}", root_cause(.0))]
    Request(legacy::Error),
    #[error("the connection broke: {0}")]
    Body(#[from] hyper::Error),
    #[error("it answers with status {}", .0.as_u16())]
    Status(StatusCode),
    #[error("the size of its file differs")]
    Size,
    #[error("its file was altered")]
    Altered,
}

/// The innermost cause: the outer ones only say "client error".
fn root_cause(error: &legacy::Error) -> &dyn Error {
    let mut cause: &dyn Error = error;
    while let Some(inner) = cause.source() {
        cause = inner;
    }
    cause
}

/// What a client knows of the store.
#[derive(Debug)]
pub(super) struct Direct {
    /// Whether the store may be used without TLS.
    allows_plaintext: bool,
    pub(super) reads: Switch,
    pub(super) writes: Switch,
    /// Made at the first request, since it reads the authorities that the system trusts.
    http: OnceLock<Http>,
    /// Local addresses of connections that have brought an answer.
    used: Mutex<HashSet<SocketAddr>>,
}

impl Direct {
    /// A store without TLS is used only if `allows_plaintext`.
    pub(super) fn new(allows_plaintext: bool) -> Self {
        Self {
            allows_plaintext,
            reads: Switch::new("the object store is not read directly"),
            writes: Switch::new("the object store is not written directly"),
            http: OnceLock::new(),
            used: Mutex::default(),
        }
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

    async fn errors(direct: &Direct, url: &str) -> [DirectError; 2] {
        let read = direct.get(url, 0, 9).await;
        let written = direct.put(url, &HashMap::new(), &[Bytes::new()]).await;
        match (read, written) {
            (Err(read), Err(written)) => [read, written],
            _ => panic!("nobody is there"),
        }
    }

    #[tokio::test]
    async fn an_error_does_not_tell_the_url() {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("a port");
        let address = listener.local_addr().expect("an address");
        drop(listener);
        let secret = "k?X-Amz-Signature=0f";
        let gone = errors(&Direct::new(true), &format!("http://{address}/{secret}")).await;
        assert!(
            gone.iter().all(|it| matches!(it, DirectError::Connect(_))),
            "{gone:?}"
        );
        let plaintext = errors(&Direct::new(false), &format!("http://{address}/{secret}")).await;
        assert!(
            plaintext
                .iter()
                .all(|it| matches!(it, DirectError::Plaintext)),
            "{plaintext:?}"
        );
        let other = errors(&Direct::new(true), &format!("ftp://{address}/{secret}")).await;
        assert!(
            other.iter().all(|it| matches!(it, DirectError::Url)),
            "{other:?}"
        );
        let bad = errors(&Direct::new(true), "no url X-Amz-Signature=0f").await;
        for error in [gone, plaintext, other, bad].as_flattened() {
            let told = format!("{error} {error:?}");
            assert!(!told.contains("0f"), "{told}");
        }
    }
}
