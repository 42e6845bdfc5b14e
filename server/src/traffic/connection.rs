//! Limits the number of connections, and closes idle ones.

use super::{Client, Traffic};
use crate::listen::InProcess;
use std::any::Any;
use std::io;
use std::pin::Pin;
use std::sync::atomic::Ordering;
use std::sync::{Arc, PoisonError};
use std::task::{Context, Poll, ready};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::sync::OwnedSemaphorePermit;
use tokio::time::{Instant, Sleep};
use tonic::transport::server::Connected;
use yoto_process::metrics::METRICS;

/// A connection that counts towards the limit.
#[derive(Debug)]
pub(crate) struct Admitted<IO> {
    io: IO,
    client: Arc<Client>,
    /// The next time to check whether the connection is idle.
    check: Pin<Box<Sleep>>,
    idle: Duration,
    _place: OwnedSemaphorePermit,
}

impl Traffic {
    /// Admits a connection unless the limit is reached.
    pub(crate) fn admit<IO: Connected>(&self, io: IO) -> Option<Admitted<IO>> {
        let Ok(place) = Arc::clone(&self.connections).try_acquire_owned() else {
            METRICS.refused();
            tracing::warn!(
                limit = self.limits.connections,
                "a connection was refused: too many are open"
            );
            return None;
        };
        let in_process = (&io.connect_info() as &dyn Any).is::<InProcess>();
        Some(Admitted {
            io,
            client: Arc::new(Client {
                in_process,
                ..self.client()
            }),
            check: Box::pin(tokio::time::sleep(self.limits.idle)),
            idle: self.limits.idle,
            _place: place,
        })
    }
}

impl Client {
    /// The end of the last call; `None` during a call.
    fn quiet_since(&self) -> Option<Instant> {
        let since = self.quiet_since.lock();
        let since = since.unwrap_or_else(PoisonError::into_inner);
        (self.calls.load(Ordering::SeqCst) == 0).then_some(*since)
    }
}

impl<IO> Admitted<IO> {
    /// Ready once the connection has been idle for the maximum time.
    fn poll_idle(&mut self, context: &mut Context<'_>) -> Poll<()> {
        loop {
            ready!(self.check.as_mut().poll(context));
            let until = match self.client.quiet_since() {
                Some(since) => since + self.idle,
                None => Instant::now() + self.idle,
            };
            if until <= Instant::now() {
                return Poll::Ready(());
            }
            self.check.as_mut().reset(until);
        }
    }
}

impl<IO: Connected> Connected for Admitted<IO> {
    type ConnectInfo = Arc<Client>;

    fn connect_info(&self) -> Arc<Client> {
        Arc::clone(&self.client)
    }
}

impl<IO: AsyncRead + Unpin> AsyncRead for Admitted<IO> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        if let Poll::Ready(read) = Pin::new(&mut self.io).poll_read(context, buffer) {
            return Poll::Ready(read);
        }
        // Read as an end of the stream, as if the client had closed the connection.
        self.poll_idle(context).map(Ok)
    }
}

impl<IO: AsyncWrite + Unpin> AsyncWrite for Admitted<IO> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.io).poll_write(context, bytes)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        pieces: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.io).poll_write_vectored(context, pieces)
    }

    fn is_write_vectored(&self) -> bool {
        self.io.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.io).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.io).poll_shutdown(context)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::TrafficLimits;
    use tokio::io::AsyncReadExt;

    fn traffic() -> Arc<Traffic> {
        Traffic::new(&TrafficLimits {
            connections: 1,
            idle: Duration::from_millis(5),
            ..TrafficLimits::default()
        })
    }

    #[tokio::test]
    async fn connections_beyond_the_limit_are_refused_until_another_ends() {
        let traffic = traffic();
        let first = traffic.admit(tokio::io::duplex(1).0).expect("has a place");
        assert!(traffic.admit(tokio::io::duplex(1).0).is_none());
        drop(first);
        assert!(traffic.admit(tokio::io::duplex(1).0).is_some());
    }

    #[tokio::test]
    async fn a_connection_without_calls_ends() {
        let (_client, service) = tokio::io::duplex(64);
        let mut connection = traffic().admit(service).expect("has a place");
        let read = connection.read(&mut [0; 8]).await.expect("reads");
        assert_eq!(read, 0, "the end");
    }

    #[tokio::test]
    async fn a_connection_with_a_call_stays() {
        let (_far, service) = tokio::io::duplex(64);
        let mut connection = traffic().admit(service).expect("has a place");
        let client = Arc::clone(&connection.client);
        client.calls.fetch_add(1, Ordering::SeqCst);
        let mut bytes = [0; 8];
        let mut reading = Box::pin(connection.read(&mut bytes));
        tokio::select! {
            read = &mut reading => panic!("ended: {read:?}"),
            // 20 times the idle limit.
            () = tokio::time::sleep(Duration::from_millis(100)) => {}
        }
        client.calls.fetch_sub(1, Ordering::SeqCst);
        assert_eq!(reading.await.expect("reads"), 0, "the end");
    }
}
