//! A TCP proxy on loopback that cuts connections after a number of bytes, or holds all bytes back.

use anyhow::Result;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;

/// Without a limit.
const NEVER: u64 = u64::MAX;

/// A running proxy; it ends with the process.
#[derive(Debug, Clone)]
pub struct Proxy {
    address: SocketAddr,
    state: Arc<State>,
}

#[derive(Debug)]
struct State {
    /// Bytes from clients that still pass before the next cut.
    left: AtomicU64,
    cuts: AtomicU64,
    /// Whether nothing passes.
    held: watch::Sender<bool>,
}

impl State {
    /// Waits until bytes may pass.
    async fn free(&self) {
        // The sender is this state's own: it is there.
        let _ = self.held.subscribe().wait_for(|held| !held).await;
    }
}

impl Proxy {
    /// Starts one in front of `target`.
    ///
    /// # Errors
    /// When no port is free.
    pub async fn start(target: SocketAddr) -> Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await?;
        let proxy = Self {
            address: listener.local_addr()?,
            state: Arc::new(State {
                left: AtomicU64::new(NEVER),
                cuts: AtomicU64::new(0),
                held: watch::Sender::new(false),
            }),
        };
        let state = Arc::clone(&proxy.state);
        tokio::spawn(async move {
            while let Ok((client, _)) = listener.accept().await {
                let state = Arc::clone(&state);
                // A connection that breaks is what clients must live with.
                tokio::spawn(async move { pass(client, target, &state).await });
            }
        });
        Ok(proxy)
    }

    /// Its address for clients.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Has the connection cut that carries the `bytes`-th byte from now on.
    pub fn cut_after(&self, bytes: u64) {
        self.state.left.store(bytes, Ordering::SeqCst);
    }

    /// Holds everything back from now on, in both directions; or lets it pass, with what was held.
    pub fn hold(&self, held: bool) {
        self.state.held.send_replace(held);
    }

    /// Number of cuts so far.
    pub fn cuts(&self) -> u64 {
        self.state.cuts.load(Ordering::SeqCst)
    }
}

/// Passes bytes in both directions until a side ends, or the connection is cut.
async fn pass(mut client: TcpStream, target: SocketAddr, state: &State) -> std::io::Result<()> {
    state.free().await;
    let mut server = TcpStream::connect(target).await?;
    let (mut from_client, mut to_client) = client.split();
    let (mut from_server, mut to_server) = server.split();
    let up = async {
        let mut buffer = vec![0; 16 << 10];
        loop {
            let read = from_client.read(&mut buffer).await?;
            state.free().await;
            if read == 0 {
                return to_server.shutdown().await;
            }
            let left = state.left.load(Ordering::SeqCst);
            if left != NEVER && read as u64 >= left {
                state.left.store(NEVER, Ordering::SeqCst);
                state.cuts.fetch_add(1, Ordering::SeqCst);
                to_server.write_all(&buffer[..left as usize]).await?;
                return Ok(());
            }
            if left != NEVER {
                state.left.store(left - read as u64, Ordering::SeqCst);
            }
            to_server.write_all(&buffer[..read]).await?;
        }
    };
    let down = async {
        let mut buffer = vec![0; 16 << 10];
        loop {
            let read = from_server.read(&mut buffer).await?;
            state.free().await;
            if read == 0 {
                return to_client.shutdown().await;
            }
            to_client.write_all(&buffer[..read]).await?;
        }
    };
    tokio::select! {
        ended = up => ended,
        ended = down => ended,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    /// A server's listener, and a proxy in front of it.
    async fn start() -> (TcpListener, Proxy) {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await;
        let listener = listener.expect("a port");
        let proxy = Proxy::start(listener.local_addr().expect("an address")).await;
        (listener, proxy.expect("a proxy"))
    }

    #[tokio::test]
    async fn a_connection_is_cut_at_the_byte() {
        let (listener, proxy) = start().await;
        proxy.cut_after(5);
        let mut client = TcpStream::connect(proxy.address()).await.expect("connects");
        client.write_all(b"0123456789").await.expect("sends");
        let (mut server, _) = listener.accept().await.expect("a connection");
        let mut arrived = Vec::new();
        server.read_to_end(&mut arrived).await.expect("an end");
        assert_eq!((arrived.as_slice(), proxy.cuts()), (&b"01234"[..], 1));
    }

    #[tokio::test]
    async fn what_was_held_back_arrives_later() {
        let (listener, proxy) = start().await;
        let mut client = TcpStream::connect(proxy.address()).await.expect("connects");
        let (mut server, _) = listener.accept().await.expect("a connection");
        proxy.hold(true);
        client.write_all(b"beat").await.expect("sends");
        let mut arrived = [0; 4];
        let early = tokio::time::timeout(Duration::from_millis(100), server.read(&mut arrived));
        assert!(early.await.is_err(), "nothing passes");
        proxy.hold(false);
        server.read_exact(&mut arrived).await.expect("arrives");
        assert_eq!(&arrived, b"beat");
    }
}
