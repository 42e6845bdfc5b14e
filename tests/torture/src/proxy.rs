//! A proxy on loopback that cuts connections after a number of bytes, holds all bytes back, or refuses everybody.

use anyhow::Result;
use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream, UnixStream};
use tokio::sync::watch;

/// Without a limit.
const NEVER: u64 = u64::MAX;

/// What a proxy stands before.
#[derive(Debug, Clone)]
pub(crate) enum Target {
    /// A port.
    Port(SocketAddr),
    /// A socket of the file system.
    Socket(PathBuf),
}

/// What a proxy does with connections and bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Gate {
    /// Passes them.
    Open,
    /// Holds them back, and passes them later: a network that drops packets.
    Held,
    /// Ends open connections, and new ones at once: a machine that is gone.
    Refused,
}

/// A running proxy; it ends with the process.
#[derive(Debug, Clone)]
pub(crate) struct Proxy {
    address: SocketAddr,
    state: Arc<State>,
}

#[derive(Debug)]
struct State {
    targets: Vec<Target>,
    /// Number of connections so far: each goes to the next target.
    opened: AtomicUsize,
    /// Connections that are open.
    open: AtomicUsize,
    /// Bytes from clients that still pass before the next cut.
    left: AtomicU64,
    cuts: AtomicU64,
    gate: watch::Sender<Gate>,
}

impl State {
    /// Waits until bytes may pass.
    async fn free(&self) {
        self.is(Gate::Open).await;
    }

    async fn is(&self, wanted: Gate) {
        // The sender is this state's own: it is there.
        let _ = self.gate.subscribe().wait_for(|gate| *gate == wanted).await;
    }
}

impl Proxy {
    /// Starts one in front of `targets`, which take turns.
    ///
    /// # Errors
    /// When no port is free.
    pub(crate) async fn start(targets: Vec<Target>) -> Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await?;
        let proxy = Self {
            address: listener.local_addr()?,
            state: Arc::new(State {
                targets,
                opened: AtomicUsize::new(0),
                open: AtomicUsize::new(0),
                left: AtomicU64::new(NEVER),
                cuts: AtomicU64::new(0),
                gate: watch::Sender::new(Gate::Open),
            }),
        };
        let state = Arc::clone(&proxy.state);
        tokio::spawn(async move {
            while let Ok((client, _)) = listener.accept().await {
                let state = Arc::clone(&state);
                // A connection that breaks is what clients must live with.
                tokio::spawn(async move {
                    tokio::select! {
                        () = state.is(Gate::Refused) => {}
                        _ = pass(client, &state) => {}
                    }
                });
            }
        });
        Ok(proxy)
    }

    /// Its address for clients.
    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }

    /// Has the connection cut that carries the `bytes`-th byte from now on.
    pub(crate) fn cut_after(&self, bytes: u64) {
        self.state.left.store(bytes, Ordering::SeqCst);
    }

    /// Does this with connections and bytes from now on, in both directions.
    pub(crate) fn set(&self, gate: Gate) {
        self.state.gate.send_replace(gate);
    }

    /// Number of cuts so far.
    pub(crate) fn cuts(&self) -> u64 {
        self.state.cuts.load(Ordering::SeqCst)
    }

    /// Number of connections to a target so far.
    pub(crate) fn opened(&self) -> usize {
        self.state.opened.load(Ordering::SeqCst)
    }

    /// Number of connections that are open.
    pub(crate) fn open(&self) -> usize {
        self.state.open.load(Ordering::SeqCst)
    }
}

/// An open connection counts as long as this lives.
struct Counted<'a>(&'a AtomicUsize);

impl Drop for Counted<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::SeqCst);
    }
}

/// Passes bytes in both directions until a side ends, or the connection is cut.
async fn pass(client: TcpStream, state: &State) -> io::Result<()> {
    state.free().await;
    let turn = state.opened.fetch_add(1, Ordering::SeqCst);
    state.open.fetch_add(1, Ordering::SeqCst);
    let _counted = Counted(&state.open);
    match &state.targets[turn % state.targets.len()] {
        Target::Port(address) => between(client, TcpStream::connect(address).await?, state).await,
        Target::Socket(path) => between(client, UnixStream::connect(path).await?, state).await,
    }
}

async fn between(
    mut client: TcpStream,
    server: impl AsyncRead + AsyncWrite,
    state: &State,
) -> io::Result<()> {
    let (mut from_client, mut to_client) = client.split();
    let (mut from_server, mut to_server) = tokio::io::split(server);
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
        let proxy = listener.local_addr().expect("an address");
        let proxy = Proxy::start(vec![Target::Port(proxy)]).await;
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
        proxy.set(Gate::Held);
        client.write_all(b"beat").await.expect("sends");
        let mut arrived = [0; 4];
        let early = tokio::time::timeout(Duration::from_millis(100), server.read(&mut arrived));
        assert!(early.await.is_err(), "nothing passes");
        proxy.set(Gate::Open);
        server.read_exact(&mut arrived).await.expect("arrives");
        assert_eq!(&arrived, b"beat");
    }

    #[tokio::test]
    async fn who_is_refused_loses_the_connection_and_may_come_back() {
        let (listener, proxy) = start().await;
        let mut client = TcpStream::connect(proxy.address()).await.expect("connects");
        let (_server, _) = listener.accept().await.expect("a connection");
        assert_eq!((proxy.opened(), proxy.open()), (1, 1));
        proxy.set(Gate::Refused);
        let ended = client.read(&mut [0; 4]).await;
        assert!(matches!(ended, Ok(0) | Err(_)), "{ended:?}");
        let mut again = TcpStream::connect(proxy.address()).await.expect("connects");
        let ended = again.read(&mut [0; 4]).await;
        assert!(matches!(ended, Ok(0) | Err(_)), "{ended:?}");
        proxy.set(Gate::Open);
        let _client = TcpStream::connect(proxy.address()).await.expect("connects");
        listener.accept().await.expect("a connection");
        assert_eq!(proxy.opened(), 2, "nobody came through meanwhile");
    }

    #[tokio::test]
    async fn targets_take_turns() {
        let listen = async || {
            TcpListener::bind((Ipv4Addr::LOCALHOST, 0))
                .await
                .expect("a port")
        };
        let (first, second) = (listen().await, listen().await);
        let target = |it: &TcpListener| Target::Port(it.local_addr().expect("an address"));
        let proxy = Proxy::start(vec![target(&first), target(&second)]).await;
        let address = proxy.expect("a proxy").address();
        let _one = TcpStream::connect(address).await.expect("connects");
        first.accept().await.expect("a connection");
        let _two = TcpStream::connect(address).await.expect("connects");
        second.accept().await.expect("a connection");
    }
}
