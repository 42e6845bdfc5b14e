//! gRPC without a socket: the embedded worker and client use pipes in memory to the coordinator,
//! with the same protocol and code as over a network.

use futures::Stream;
use hyper_util::rt::TokioIo;
use std::io;
use std::pin::Pin;
use std::task::{Context, Poll};
use tokio::io::{AsyncRead, AsyncWrite, DuplexStream, ReadBuf};
use tokio::sync::mpsc;
use tonic::transport::server::Connected;
use tonic::transport::{Channel, Endpoint};
use yoto_proto::limits::WINDOW_BYTES;

/// Bytes that a pipe holds in each direction before its writer waits.
const PIPE_BYTES: usize = 1 << 20;
/// Connections that may wait to be accepted.
const BACKLOG: usize = 64;

/// Both ends of an in-memory network: one to connect with, one to serve.
pub fn in_memory() -> (InMemoryConnector, InMemoryIncoming) {
    let (sender, receiver) = mpsc::channel(BACKLOG);
    (InMemoryConnector { sender }, InMemoryIncoming { receiver })
}

/// Connects to the server of the pair's [`InMemoryIncoming`].
#[derive(Debug, Clone)]
pub struct InMemoryConnector {
    sender: mpsc::Sender<InMemoryStream>,
}

impl InMemoryConnector {
    /// A channel that connects at its first call, and again when its connection is lost.
    pub fn channel(&self) -> Channel {
        let sender = self.sender.clone();
        let connect = tower::service_fn(move |_| {
            let sender = sender.clone();
            async move {
                let (near, far) = tokio::io::duplex(PIPE_BYTES);
                let refused = |_| io::Error::from(io::ErrorKind::ConnectionRefused);
                sender.send(InMemoryStream(far)).await.map_err(refused)?;
                Ok::<_, io::Error>(TokioIo::new(near))
            }
        });
        // The address only fills the protocol's authority header.
        Endpoint::from_static("http://in-memory")
            .initial_stream_window_size(WINDOW_BYTES)
            .initial_connection_window_size(WINDOW_BYTES)
            .connect_with_connector_lazy(connect)
    }
}

/// A connection from this process.
#[derive(Debug)]
pub struct InMemoryStream(DuplexStream);

/// What a service knows of a connection from its own process.
#[derive(Debug, Clone, Copy)]
pub struct InProcess;

impl Connected for InMemoryStream {
    type ConnectInfo = InProcess;

    fn connect_info(&self) -> InProcess {
        InProcess
    }
}

impl AsyncRead for InMemoryStream {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.0).poll_read(cx, buffer)
    }
}

impl AsyncWrite for InMemoryStream {
    fn poll_write(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.0).poll_write(cx, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.0).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.0).poll_shutdown(cx)
    }
}

/// The connections to serve; ends when every connector and channel is gone.
#[derive(Debug)]
pub struct InMemoryIncoming {
    receiver: mpsc::Receiver<InMemoryStream>,
}

impl Stream for InMemoryIncoming {
    type Item = io::Result<InMemoryStream>;

    fn poll_next(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        self.receiver.poll_recv(cx).map(|stream| stream.map(Ok))
    }
}
