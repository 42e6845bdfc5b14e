//! The connections of a TCP listener.

use futures::Stream;
use std::io;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};

/// Pause after a connection that could not be accepted. Mostly the process has no file descriptor left, and one is free
/// again when another connection ends.
const PAUSE: Duration = Duration::from_millis(100);

/// The connections of `listener`, without end: a connection that can't be accepted is none of the others'.
///
/// They send at once what is written. Otherwise the end of an answer waits until the client has acknowledged its
/// beginning, which systems do after 40 ms.
pub fn tcp(listener: TcpListener) -> impl Stream<Item = io::Result<TcpStream>> + Send {
    futures::stream::unfold(listener, |listener| async {
        loop {
            match listener.accept().await {
                Ok((connection, _)) => {
                    if let Err(error) = connection.set_nodelay(true) {
                        tracing::debug!(%error, "a connection was lost at once");
                        continue;
                    }
                    return Some((Ok(connection), listener));
                }
                Err(error) => {
                    tracing::warn!(%error, "a connection can't be accepted");
                    tokio::time::sleep(PAUSE).await;
                }
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures::StreamExt;
    use std::pin::pin;

    #[tokio::test]
    async fn accepted_connections_send_at_once() {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("binds");
        let address = listener.local_addr().expect("has an address");
        let mut connections = pin!(tcp(listener));
        for _ in 0..2 {
            let _client = TcpStream::connect(address).await.expect("connects");
            let accepted = connections.next().await.expect("has no end");
            let accepted = accepted.expect("is accepted");
            assert!(accepted.nodelay().expect("is open"));
        }
    }
}
