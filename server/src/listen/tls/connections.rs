//! Encrypted connections.

use super::Certificates;
use crate::listen::{Peer, tcp};
use futures::{Stream, StreamExt};
use std::io;
use std::net::IpAddr;
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::{Timeout, timeout};
use tokio_rustls::server::TlsStream;
use tokio_rustls::{Accept, TlsAcceptor};
use tonic::transport::server::Connected;

/// Longest time of a handshake.
const HANDSHAKE: Duration = Duration::from_secs(10);

/// A connection that does its handshake when it is first read or written. Until then it counts as every other connection does, so
/// that those whose handshake never ends have their address's share and no more.
pub struct Encrypted {
    state: State,
    peer: IpAddr,
}

enum State {
    Handshake(Pin<Box<Timeout<Accept<TcpStream>>>>),
    Open(Box<TlsStream<TcpStream>>),
    Failed,
}

impl std::fmt::Debug for Encrypted {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let open = matches!(self.state, State::Open(_));
        out.debug_struct("Encrypted")
            .field("peer", &self.peer)
            .field("open", &open)
            .finish()
    }
}

/// The connections that `listener` accepts. The stream never ends. A client that does not trust the certificate, or has none
/// where one is asked for, is logged at the level `debug`: strangers can cause it.
pub fn tls(
    listener: TcpListener,
    certificates: Certificates,
) -> impl Stream<Item = io::Result<Encrypted>> + Send {
    tcp(listener).filter_map(move |connection| {
        let encrypted = connection.and_then(|connection| {
            let peer = connection.peer_addr()?.ip();
            let handshake = TlsAcceptor::from(certificates.current()).accept(connection);
            let state = State::Handshake(Box::pin(timeout(HANDSHAKE, handshake)));
            Ok(Encrypted { state, peer })
        });
        let found = match encrypted {
            Ok(encrypted) => Some(Ok(encrypted)),
            Err(error) => {
                tracing::debug!(%error, "a connection was lost right after its accept");
                None
            }
        };
        std::future::ready(found)
    })
}

impl Encrypted {
    /// The stream, once the handshake has succeeded.
    fn poll_open(
        &mut self,
        context: &mut Context<'_>,
    ) -> Poll<io::Result<Pin<&mut TlsStream<TcpStream>>>> {
        if let State::Handshake(handshake) = &mut self.state {
            let error = match ready!(handshake.as_mut().poll(context)) {
                Ok(Ok(stream)) => {
                    self.state = State::Open(Box::new(stream));
                    None
                }
                Ok(Err(error)) => Some(error),
                Err(late) => Some(late.into()),
            };
            if let Some(error) = error {
                tracing::debug!(%error, "a handshake of TLS failed");
                self.state = State::Failed;
                return Poll::Ready(Err(error));
            }
        }
        Poll::Ready(match &mut self.state {
            State::Open(stream) => Ok(Pin::new(stream.as_mut())),
            State::Handshake(_) | State::Failed => Err(io::ErrorKind::NotConnected.into()),
        })
    }
}

impl Connected for Encrypted {
    type ConnectInfo = Peer;

    fn connect_info(&self) -> Peer {
        Peer(self.peer)
    }
}

impl AsyncRead for Encrypted {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        ready!(self.poll_open(context))?.poll_read(context, buffer)
    }
}

impl AsyncWrite for Encrypted {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        ready!(self.poll_open(context))?.poll_write(context, bytes)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        pieces: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        ready!(self.poll_open(context))?.poll_write_vectored(context, pieces)
    }

    fn is_write_vectored(&self) -> bool {
        // As the stream says once it is open.
        true
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        match &mut self.state {
            State::Open(stream) => Pin::new(stream.as_mut()).poll_flush(context),
            // Nothing was written yet.
            State::Handshake(_) | State::Failed => Poll::Ready(Ok(())),
        }
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        match &mut self.state {
            State::Open(stream) => Pin::new(stream.as_mut()).poll_shutdown(context),
            State::Handshake(_) | State::Failed => Poll::Ready(Ok(())),
        }
    }
}
