//! Limits the number of connections, and closes idle ones and those that give way.

use super::{Client, Traffic};
use crate::capacity::Owner;
use crate::listen::{InProcess, Peer};
use std::any::Any;
use std::io;
use std::pin::Pin;
use std::sync::atomic::Ordering;
use std::sync::{Arc, PoisonError};
use std::task::{Context, Poll, ready};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::{Instant, Sleep};
use tokio_util::sync::WaitForCancellationFutureOwned;
use tonic::transport::server::{Connected, TcpConnectInfo};
use yoto_process::metrics::METRICS;

/// A connection that counts towards the limit.
#[derive(Debug)]
pub(crate) struct Admitted<IO> {
    io: IO,
    client: Arc<Client>,
    /// The next time to check whether the connection is idle.
    check: Pin<Box<Sleep>>,
    /// Longest time without a call before a call was admitted, and after it.
    idle: (Duration, Duration),
    gives_way: Pin<Box<WaitForCancellationFutureOwned>>,
}

impl Traffic {
    /// Admits a connection, to which another one without an admitted call gives way if places are short.
    pub(crate) fn admit<IO: Connected>(&self, io: IO) -> Option<Admitted<IO>> {
        let info = io.connect_info();
        let info = &info as &dyn Any;
        let peer = info.downcast_ref::<Peer>().map(|it| it.0);
        let address = peer.or_else(|| {
            let tcp = info.downcast_ref::<TcpConnectInfo>()?;
            tcp.remote_addr().map(|it| it.ip())
        });
        let owner = address.filter(|_| self.limits.by_address).map(Owner::at);
        let owners = owner.as_slice();
        let place = match self.pools.waiting_connections.take(owners, 1) {
            Ok(place) => place,
            Err(error) => match self.waiting.give_way(owner.as_ref()) {
                Some(place) => self.pools.waiting_connections.hand_over(place, owners),
                None => {
                    METRICS.refused();
                    tracing::warn!(%error, "a connection was refused");
                    return None;
                }
            },
        };
        let client = Arc::new(self.client(owner, place, info.is::<InProcess>()));
        self.waiting.add(&client);
        Some(Admitted {
            io,
            check: Box::pin(tokio::time::sleep(self.limits.first_call)),
            idle: (self.limits.first_call, self.limits.idle),
            gives_way: Box::pin(client.gives_way.clone().cancelled_owned()),
            client,
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
    /// Ready once the connection has been idle for the maximum time, or has to give way.
    fn poll_idle(&mut self, context: &mut Context<'_>) -> Poll<()> {
        if self.gives_way.as_mut().poll(context).is_ready() {
            return Poll::Ready(());
        }
        loop {
            ready!(self.check.as_mut().poll(context));
            let idle = match self.client.was_admitted() {
                true => self.idle.1,
                false => self.idle.0,
            };
            let until = self.client.quiet_since().unwrap_or_else(Instant::now) + idle;
            if until <= Instant::now() {
                return Poll::Ready(());
            }
            self.check.as_mut().reset(until);
        }
    }
}

impl<IO> Drop for Admitted<IO> {
    fn drop(&mut self) {
        // A call that is still answered keeps the client, but no connection.
        let mut place = self
            .client
            .place
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        place.take();
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
        // Who sends without a pause gives way too.
        if !self.client.gives_way.is_cancelled()
            && let Poll::Ready(read) = Pin::new(&mut self.io).poll_read(context, buffer)
        {
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
    use crate::capacity::NoPlace;
    use crate::config::TrafficLimits;
    use std::net::IpAddr;
    use tokio::io::{AsyncReadExt, DuplexStream};

    fn traffic() -> Arc<Traffic> {
        Traffic::new(&TrafficLimits {
            waiting_connections: 1,
            first_call: Duration::from_millis(5),
            idle: Duration::from_millis(5),
            ..TrafficLimits::default()
        })
    }

    impl<IO> Admitted<IO> {
        /// Has a call of this tenant admitted.
        fn call(&self, traffic: &Traffic, tenant: &str) -> Result<(), NoPlace> {
            let owner = Owner::Tenant(tenant.into());
            self.client.admitted(&traffic.pools.connections, &[owner])
        }
    }

    #[tokio::test]
    async fn a_tenant_has_a_share_of_the_connections_with_admitted_calls() {
        let traffic = Traffic::new(&TrafficLimits {
            connections: 4,
            ..TrafficLimits::default()
        });
        let connect = || traffic.admit(tokio::io::duplex(1).0).expect("has a place");
        let greedy = [connect(), connect(), connect()];
        greedy[0].call(&traffic, "greedy").expect("is in the share");
        greedy[0].call(&traffic, "greedy").expect("is the same one");
        greedy[1].call(&traffic, "greedy").expect("is in the share");
        assert!(greedy[2].call(&traffic, "greedy").is_err());
        greedy[2].call(&traffic, "other").expect("is another's");
        drop(greedy);
        for _ in 0..2 {
            connect()
                .call(&traffic, "greedy")
                .expect("a place is free again");
        }
    }

    /// A connection of an address.
    struct From(IpAddr, DuplexStream);

    impl Connected for From {
        type ConnectInfo = Peer;

        fn connect_info(&self) -> Peer {
            Peer(self.0)
        }
    }

    impl AsyncRead for From {
        fn poll_read(
            mut self: Pin<&mut Self>,
            context: &mut Context<'_>,
            buffer: &mut ReadBuf<'_>,
        ) -> Poll<io::Result<()>> {
            Pin::new(&mut self.1).poll_read(context, buffer)
        }
    }

    fn from(host: u8) -> (From, DuplexStream) {
        let (near, far) = tokio::io::duplex(64);
        (From(IpAddr::from([192, 0, 2, host]), near), far)
    }

    /// Whether the connection stays open for ten times the limit until a first call.
    async fn stays(connection: &mut Admitted<From>) -> bool {
        let mut bytes = [0; 8];
        let read = connection.read(&mut bytes);
        tokio::time::timeout(Duration::from_millis(50), read)
            .await
            .is_err()
    }

    #[tokio::test]
    async fn strangers_give_way_and_callers_stay() {
        let traffic = Traffic::new(&TrafficLimits {
            waiting_connections: 8,
            ..TrafficLimits::default()
        });
        let mut far = Vec::new();
        let mut connect = |host| {
            let (near, other) = from(host);
            far.push(other);
            traffic.admit(near)
        };
        let mut caller = connect(1).expect("has a place");
        caller.call(&traffic, "lab").expect("is admitted");
        let mut strangers: Vec<_> = (0..4)
            .map(|_| connect(1).expect("is in the share"))
            .collect();
        // The fifth takes the place of the oldest stranger of its address.
        let _fifth = connect(1).expect("one gives way");
        assert_eq!(strangers[0].read(&mut [0; 8]).await.expect("reads"), 0);
        assert!(stays(&mut strangers[1]).await, "is newer");
        // Others find places until all are taken; then the address with the most strangers gives.
        let _second: Vec<_> = (0..2)
            .map(|_| connect(2).expect("is in the share"))
            .collect();
        let _third = connect(3).expect("is in the share");
        let mut fourth = connect(4).expect("the last place");
        let _last = connect(5).expect("one of the first address gives way");
        assert_eq!(strangers[1].read(&mut [0; 8]).await.expect("reads"), 0);
        assert!(stays(&mut fourth).await, "its address has one alone");
        assert!(stays(&mut caller).await, "a caller stays");
    }

    #[tokio::test]
    async fn a_connection_without_an_admitted_call_ends_earlier() {
        let traffic = Traffic::new(&TrafficLimits {
            first_call: Duration::from_millis(5),
            ..TrafficLimits::default()
        });
        let (near, _far) = from(1);
        let mut stranger = traffic.admit(near).expect("has a place");
        assert_eq!(stranger.read(&mut [0; 8]).await.expect("reads"), 0);
        let (near, _far) = from(1);
        let mut caller = traffic.admit(near).expect("has a place");
        caller.call(&traffic, "lab").expect("is admitted");
        assert!(stays(&mut caller).await, "has the longer time");
    }

    #[tokio::test]
    async fn a_connection_without_calls_ends() {
        let (_client, service) = tokio::io::duplex(64);
        let traffic = traffic();
        let mut connection = traffic.admit(service).expect("has a place");
        connection.call(&traffic, "lab").expect("is admitted");
        let read = connection.read(&mut [0; 8]).await.expect("reads");
        assert_eq!(read, 0, "the end");
    }

    #[tokio::test]
    async fn a_connection_with_a_call_stays() {
        let (_far, service) = tokio::io::duplex(64);
        let traffic = traffic();
        let mut connection = traffic.admit(service).expect("has a place");
        connection.call(&traffic, "lab").expect("is admitted");
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
