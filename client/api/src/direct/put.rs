//! Objects that the store takes.

use super::{Direct, DirectError};
use bytes::Bytes;
use http_body_util::{BodyExt, Limited, StreamBody};
use hyper::Request;
use hyper::body::Frame;
use hyper::header::CONTENT_LENGTH;
use std::collections::HashMap;
use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;
use tokio::time::timeout;

/// Longest wait until the store takes more, or answers. What the system has taken for it by then may be under way for long.
const WRITE_TIMEOUT: Duration = Duration::from_secs(60);
/// Longest answer after which a connection is kept, bytes. The answer to a PUT is mostly empty.
const ANSWER_BYTES: usize = 64 << 10;

impl Direct {
    /// Writes `chunks`, one after the other, to `url` with these `headers`.
    pub(crate) async fn put(
        &self,
        url: &str,
        headers: &HashMap<String, String>,
        chunks: &[Bytes],
    ) -> Result<(), DirectError> {
        let uri = self.parse(url)?;
        let length: usize = chunks.iter().map(Bytes::len).sum();
        let taken = Arc::new(AtomicU64::new(0));
        let request = || {
            let mut request = Request::put(&uri).header(CONTENT_LENGTH, length);
            for (name, value) in headers {
                request = request.header(name, value);
            }
            let taken = Arc::clone(&taken);
            let frames = chunks.to_vec().into_iter().map(move |chunk| {
                taken.fetch_add(1, Ordering::Relaxed);
                Ok::<_, Infallible>(Frame::data(chunk))
            });
            let body = StreamBody::new(tokio_stream::iter(frames)).boxed_unsync();
            request.body(body).map_err(|_| DirectError::Url)
        };
        let mut answer = std::pin::pin!(self.send(request));
        let answer = loop {
            let before = taken.load(Ordering::Relaxed);
            match timeout(WRITE_TIMEOUT, &mut answer).await {
                Ok(answer) => break answer?,
                Err(_) if taken.load(Ordering::Relaxed) > before => {}
                Err(_) => return Err(DirectError::Timeout),
            }
        };
        // Only an answer that is read to its end leaves the connection to the next request.
        let rest = Limited::new(answer.into_body(), ANSWER_BYTES).collect();
        let _ = timeout(WRITE_TIMEOUT, rest).await;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    use tokio::net::{TcpListener, TcpStream};

    /// Reads a request with a body of 9 bytes and answers with this status. Returns the request.
    async fn answer(connection: &mut TcpStream, status: &str) -> String {
        let mut read = Vec::new();
        while !read.ends_with(b"012345678") {
            assert!(connection.read_buf(&mut read).await.expect("reads") > 0);
        }
        let answer = format!("HTTP/1.1 {status}\r\ncontent-length: 2\r\n\r\nok");
        let written = connection.write_all(answer.as_bytes()).await;
        written.expect("writes");
        String::from_utf8(read).expect("is text")
    }

    #[tokio::test]
    async fn a_connection_is_kept_and_one_that_has_ended_is_replaced() {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let address = listener.local_addr().expect("an address");
        let store = tokio::spawn(async move {
            let (mut first, _) = listener.accept().await.expect("comes");
            let request = answer(&mut first, "200 OK").await;
            answer(&mut first, "403 Forbidden").await;
            let (mut second, _) = listener.accept().await.expect("comes");
            answer(&mut second, "204 No Content").await;
            drop(second);
            let (mut third, _) = listener.accept().await.expect("comes");
            answer(&mut third, "200 OK").await;
            request
        });
        let direct = Direct::new(true);
        let url = format!("http://{address}/bucket/part?signed");
        let headers = HashMap::from([("x-amz-checksum-sha256".to_owned(), "c2hh".to_owned())]);
        let chunks = ["0123", "45678"].map(Bytes::from);
        let put = async || direct.put(&url, &headers, &chunks).await;
        put().await.expect("is taken");
        let refused = put().await.expect_err("by the kept connection");
        assert!(
            matches!(refused, DirectError::Status(it) if it == 403),
            "{refused}"
        );
        put().await.expect("is taken");
        put().await.expect("is sent again");
        let request = store.await.expect("no panic");
        assert!(
            request.starts_with("PUT /bucket/part?signed HTTP/1.1\r\n"),
            "{request}"
        );
        let has = |header: &str| request.to_lowercase().contains(header);
        assert!(has("\r\ncontent-length: 9\r\n") && has("\r\nx-amz-checksum-sha256: c2hh\r\n"));
        assert!(has(&format!("\r\nhost: {address}\r\n")), "{request}");
    }
}
