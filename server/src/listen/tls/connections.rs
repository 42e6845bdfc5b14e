//! Encrypted connections.

use super::Certificates;
use crate::listen::tcp;
use futures::{Stream, StreamExt};
use std::io;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio_rustls::TlsAcceptor;
use tokio_rustls::server::TlsStream;
use tonic::transport::server::Connected;

/// Longest time of a handshake.
const HANDSHAKE: Duration = Duration::from_secs(10);
/// Handshakes at once. Others wait to be accepted, so that connections without a handshake keep no descriptors.
const HANDSHAKES: usize = 256;

/// A connection whose handshake has succeeded.
#[derive(Debug)]
pub struct Encrypted(Box<TlsStream<TcpStream>>);

/// The connections that `listener` accepts, once their handshakes have succeeded. The stream never ends. A client that does not
/// trust the certificate, or has none where one is asked for, is logged at the level `debug`: strangers can cause it.
pub fn tls(
    listener: TcpListener,
    certificates: Certificates,
) -> impl Stream<Item = io::Result<Encrypted>> + Send {
    let certificates = Arc::new(certificates);
    tcp(listener)
        .map(move |connection| {
            let certificates = Arc::clone(&certificates);
            async move {
                let acceptor = TlsAcceptor::from(certificates.current());
                let handshake = acceptor.accept(connection?);
                match tokio::time::timeout(HANDSHAKE, handshake).await {
                    Ok(Ok(stream)) => Ok(Encrypted(Box::new(stream))),
                    Ok(Err(error)) => Err(error),
                    Err(late) => Err(late.into()),
                }
            }
        })
        .buffer_unordered(HANDSHAKES)
        .filter_map(|connection: io::Result<Encrypted>| async {
            match connection {
                Ok(connection) => Some(Ok(connection)),
                Err(error) => {
                    tracing::debug!(%error, "a handshake of TLS failed");
                    None
                }
            }
        })
}

impl Connected for Encrypted {
    type ConnectInfo = ();

    fn connect_info(&self) {}
}

impl AsyncRead for Encrypted {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut *self.0).poll_read(context, buffer)
    }
}

impl AsyncWrite for Encrypted {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut *self.0).poll_write(context, bytes)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        pieces: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut *self.0).poll_write_vectored(context, pieces)
    }

    fn is_write_vectored(&self) -> bool {
        self.0.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut *self.0).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut *self.0).poll_shutdown(context)
    }
}
