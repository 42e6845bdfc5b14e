//! Accepts TCP connections. Unlike tonic's `TcpIncoming`, pauses after a failed accept instead of repeating it at once.

use futures::Stream;
use std::io;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};

/// Pause after a failed accept. Usually the process has no free file descriptor until another connection ends.
const PAUSE: Duration = Duration::from_millis(100);

/// The connections that `listener` accepts. The stream never ends: a failed accept is logged.
///
/// The connections have Nagle's algorithm turned off. With it, the end of an answer would wait for the delayed
/// acknowledgement of its beginning, about 40 ms.
pub fn tcp(listener: TcpListener) -> impl Stream<Item = io::Result<TcpStream>> + Send {
    futures::stream::unfold(listener, |listener| async {
        loop {
            match listener.accept().await {
                Ok((connection, _)) => {
                    if let Err(error) = connection.set_nodelay(true) {
                        tracing::debug!(%error, "a connection was lost right after its accept");
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
    async fn accepted_connections_have_no_delay() {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("binds");
        let address = listener.local_addr().expect("has an address");
        let mut connections = pin!(tcp(listener));
        for _ in 0..2 {
            let _client = TcpStream::connect(address).await.expect("connects");
            let accepted = connections.next().await.expect("never ends");
            let accepted = accepted.expect("is accepted");
            assert!(accepted.nodelay().expect("is open"));
        }
    }
}
