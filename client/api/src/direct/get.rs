//! Files that the store sends.

use super::send::HEADER_TIMEOUT;
use super::{Direct, DirectError};
use bytes::Bytes;
use http_body_util::{BodyExt, Empty};
use hyper::body::Incoming;
use hyper::header::{CONTENT_RANGE, RANGE};
use hyper::{Request, StatusCode};
use std::time::Duration;
use tokio::time::timeout;

/// Longest wait for the next bytes of an answer.
const READ_TIMEOUT: Duration = Duration::from_secs(30);

/// The content of a file that the store sends. Once it is read to its end, its connection is used again.
pub(crate) struct FileBody(Incoming);

impl Direct {
    /// Asks for the file of `bytes` at `url`, from the byte `from` on, which the file has.
    pub(crate) async fn get(
        &self,
        url: &str,
        from: u64,
        bytes: u64,
    ) -> Result<FileBody, DirectError> {
        let uri = self.parse(url)?;
        let request = || {
            let request = Request::get(&uri).header(RANGE, format!("bytes={from}-"));
            let request = request.body(Empty::new().boxed_unsync());
            request.map_err(|_| DirectError::Url)
        };
        let answer = timeout(HEADER_TIMEOUT, self.send(request)).await;
        let (head, body) = answer.map_err(|_| DirectError::Timeout)??.into_parts();
        if head.status != StatusCode::PARTIAL_CONTENT {
            return Err(DirectError::Status(head.status));
        }
        let expected = format!("bytes {from}-{}/{bytes}", bytes.saturating_sub(1));
        let sent = head.headers.get(CONTENT_RANGE);
        match sent.is_some_and(|it| it.as_bytes() == expected.as_bytes()) {
            true => Ok(FileBody(body)),
            false => Err(DirectError::Size),
        }
    }
}

impl FileBody {
    /// The next bytes; `None` at the end.
    pub(crate) async fn chunk(&mut self) -> Result<Option<Bytes>, DirectError> {
        loop {
            let frame = timeout(READ_TIMEOUT, self.0.frame()).await;
            let Some(frame) = frame.map_err(|_| DirectError::Timeout)? else {
                return Ok(None);
            };
            // A frame without data has trailers.
            if let Ok(chunk) = frame?.into_data() {
                return Ok(Some(chunk));
            }
        }
    }
}
