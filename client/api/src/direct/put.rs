//! Objects that the store takes.

use super::line::{Line, request};
use super::{Direct, Fault};
use bytes::Bytes;
use http_body_util::{BodyExt, Limited, StreamBody};
use hyper::body::Frame;
use hyper::header::CONTENT_LENGTH;
use hyper::{Method, Uri};
use std::collections::HashMap;
use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;
use tokio::time::timeout;

/// Longest wait until the store takes more, or answers. What the system has taken for it by then may be under way for long.
const PATIENCE: Duration = Duration::from_secs(60);
/// Longest answer after which a connection is kept, bytes. That to a PUT is mostly empty.
const ANSWER: usize = 64 << 10;

impl Direct {
    /// Writes `chunks`, one after the other, to `url` with these `headers`.
    pub(crate) async fn put(
        &self,
        url: &str,
        headers: &HashMap<String, String>,
        chunks: &[Bytes],
    ) -> Result<(), Fault> {
        let uri: Uri = url.parse().map_err(|_| Fault::Url)?;
        if let Some(line) = self.kept(&uri) {
            match self.send(line, &uri, headers, chunks).await {
                Err(fault @ Fault::Status(_)) => return Err(fault),
                // It may have ended meanwhile.
                Err(_) => {}
                sent => return sent,
            }
        }
        let line = self.open(&uri).await?;
        self.send(line, &uri, headers, chunks).await
    }

    async fn send(
        &self,
        mut line: Line,
        uri: &Uri,
        headers: &HashMap<String, String>,
        chunks: &[Bytes],
    ) -> Result<(), Fault> {
        let length: usize = chunks.iter().map(Bytes::len).sum();
        let mut request = request(Method::PUT, uri).header(CONTENT_LENGTH, length);
        for (name, value) in headers {
            request = request.header(name, value);
        }
        let taken = Arc::new(AtomicU64::new(0));
        let counted = Arc::clone(&taken);
        let owned = chunks.to_vec();
        let frames = owned.into_iter().map(move |chunk| {
            counted.fetch_add(1, Ordering::Relaxed);
            Ok::<_, Infallible>(Frame::data(chunk))
        });
        let body = StreamBody::new(tokio_stream::iter(frames)).boxed_unsync();
        let request = request.body(body).map_err(|_| Fault::Url)?;
        line.sender.ready().await?;
        let answer = {
            let mut answer = std::pin::pin!(line.sender.send_request(request));
            loop {
                let before = taken.load(Ordering::Relaxed);
                match timeout(PATIENCE, &mut answer).await {
                    Ok(answer) => break answer?,
                    Err(_) if taken.load(Ordering::Relaxed) > before => {}
                    Err(_) => return Err(Fault::Silent),
                }
            }
        };
        let (head, body) = answer.into_parts();
        if !head.status.is_success() {
            return Err(Fault::Status(head.status));
        }
        let rest = Limited::new(body, ANSWER).collect();
        if matches!(timeout(PATIENCE, rest).await, Ok(Ok(_))) {
            self.keep(line);
        }
        Ok(())
    }
}
