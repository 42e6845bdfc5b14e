//! gRPC without a socket: the embedded worker and client use pipes in memory to the coordinator,
//! with the same protocol and code as over a network.

use futures::Stream;
use hyper_util::rt::TokioIo;
use std::io;
use std::pin::Pin;
use std::task::{Context, Poll};
use tokio::io::DuplexStream;
use tokio::sync::mpsc;
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
    sender: mpsc::Sender<DuplexStream>,
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
                sender.send(far).await.map_err(refused)?;
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

/// The connections to serve; ends when every connector and channel is gone.
#[derive(Debug)]
pub struct InMemoryIncoming {
    receiver: mpsc::Receiver<DuplexStream>,
}

impl Stream for InMemoryIncoming {
    type Item = io::Result<DuplexStream>;

    fn poll_next(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        self.receiver.poll_recv(cx).map(|stream| stream.map(Ok))
    }
}
