//! Files that the store sends.

use super::line::{Line, request};
use super::{BEGIN, Direct, Fault, SILENCE};
use bytes::Bytes;
use http_body_util::{BodyExt, Empty};
use hyper::body::Incoming;
use hyper::header::{CONTENT_RANGE, RANGE};
use hyper::{Method, StatusCode, Uri};
use tokio::time::timeout;

/// A file that the store sends.
pub(crate) struct Answer {
    line: Line,
    body: Incoming,
}

impl Direct {
    /// Asks for the file of `bytes` at `url`, from the byte `from` on, which the file has.
    pub(crate) async fn get(&self, url: &str, from: u64, bytes: u64) -> Result<Answer, Fault> {
        let uri: Uri = url.parse().map_err(|_| Fault::Url)?;
        let range = (from, bytes);
        if let Some(line) = self.kept(&uri)
            // It may have ended meanwhile.
            && let Ok(Ok(answer)) = timeout(BEGIN, ask(line, &uri, range)).await
        {
            return Ok(answer);
        }
        let line = self.open(&uri).await?;
        let answer = timeout(BEGIN, ask(line, &uri, range)).await;
        answer.map_err(|_| Fault::Silent)?
    }
}

impl Answer {
    /// The next bytes; `None` at the end.
    pub(crate) async fn chunk(&mut self) -> Result<Option<Bytes>, Fault> {
        loop {
            let frame = timeout(SILENCE, self.body.frame()).await;
            let Some(frame) = frame.map_err(|_| Fault::Silent)? else {
                return Ok(None);
            };
            // What is no data are trailers.
            if let Ok(chunk) = frame?.into_data() {
                return Ok(Some(chunk));
            }
        }
    }

    /// Keeps the connection of an answer that was read to its end.
    pub(crate) fn keep(self, direct: &Direct) {
        direct.keep(self.line);
    }
}

/// Sends the request for a file of `bytes`, from the byte `from` on, and looks at the head of the answer.
async fn ask(mut line: Line, uri: &Uri, (from, bytes): (u64, u64)) -> Result<Answer, Fault> {
    let request = request(Method::GET, uri)
        .header(RANGE, format!("bytes={from}-"))
        .body(Empty::new().boxed_unsync())
        .map_err(|_| Fault::Url)?;
    line.sender.ready().await?;
    let (head, body) = line.sender.send_request(request).await?.into_parts();
    if head.status != StatusCode::PARTIAL_CONTENT {
        return Err(Fault::Status(head.status));
    }
    let expected = format!("bytes {from}-{}/{bytes}", bytes.saturating_sub(1));
    let sent = head.headers.get(CONTENT_RANGE);
    match sent.is_some_and(|it| it.as_bytes() == expected.as_bytes()) {
        true => Ok(Answer { line, body }),
        false => Err(Fault::Size),
    }
}
