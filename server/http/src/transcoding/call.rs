//! Makes a call of gRPC inside the process: the request's message goes to the same services, as the same caller.

use axum::Router;
use axum::body::Body;
use axum::http::header::{CONTENT_TYPE, TE};
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderValue, Method, Request, Uri, Version};
use bytes::{Buf, BufMut, Bytes, BytesMut};
use futures::{Stream, stream};
use http_body_util::BodyExt;
use tonic::{Code, Status};
use tower::ServiceExt;

/// Bytes before each message: a flag for compression, and its length.
const HEADER_BYTES: usize = 5;

/// A message as gRPC frames it.
///
/// # Errors
/// When its length has no 32 bits.
pub(super) fn framed(message: &[u8]) -> Result<Bytes, Status> {
    let length = u32::try_from(message.len());
    let length = length.map_err(|_| Status::out_of_range("the message is too long"))?;
    let mut frame = BytesMut::with_capacity(HEADER_BYTES + message.len());
    frame.put_u8(0);
    frame.put_u32(length);
    frame.put_slice(message);
    Ok(frame.freeze())
}

/// Sends `messages`, framed, to the call at `path` for the caller of the HTTP request `parts`, and returns its answers.
///
/// # Errors
/// That of the call.
pub(super) async fn call(
    services: Router,
    parts: &Parts,
    path: &'static str,
    messages: Body,
) -> Result<Answers, Status> {
    let mut request = Request::new(messages);
    *request.method_mut() = Method::POST;
    *request.version_mut() = Version::HTTP_2;
    *request.uri_mut() = Uri::from_static(path);
    // Who calls, for which tenant.
    *request.extensions_mut() = parts.extensions.clone();
    let headers = request.headers_mut();
    headers.insert(CONTENT_TYPE, HeaderValue::from_static("application/grpc"));
    headers.insert(TE, HeaderValue::from_static("trailers"));
    let answer = match services.oneshot(request).await {
        Ok(answer) => answer,
        Err(never) => match never {},
    };
    // An error without any message stands in the headers.
    ended(answer.headers())?;
    Ok(Answers {
        body: answer.into_body(),
        arrived: BytesMut::new(),
    })
}

/// The status in headers or trailers.
fn ended(headers: &HeaderMap) -> Result<(), Status> {
    match Status::from_header_map(headers) {
        Some(status) if status.code() != Code::Ok => Err(status),
        _ => Ok(()),
    }
}

/// The messages of an answer.
pub(super) struct Answers {
    body: Body,
    arrived: BytesMut,
}

impl Answers {
    /// The next message; `None` after the last one.
    ///
    /// # Errors
    /// That of the call.
    pub(super) async fn next(&mut self) -> Result<Option<Bytes>, Status> {
        loop {
            if let Some(message) = self.complete() {
                return Ok(Some(message));
            }
            let Some(frame) = self.body.frame().await else {
                return match self.arrived.is_empty() {
                    true => Ok(None),
                    false => Err(Status::internal("the answer broke off")),
                };
            };
            let frame = frame.map_err(|error| Status::internal(error.to_string()))?;
            match frame.into_data() {
                Ok(data) => self.arrived.extend_from_slice(&data),
                Err(frame) => {
                    if let Ok(trailers) = frame.into_trailers() {
                        ended(&trailers)?;
                    }
                }
            }
        }
    }

    /// The one message of an answer that is no stream.
    ///
    /// # Errors
    /// That of the call.
    pub(super) async fn single(mut self) -> Result<Bytes, Status> {
        let message = self.next().await?;
        // The status comes after it.
        while self.next().await?.is_some() {}
        message.ok_or_else(|| Status::internal("the call has no answer"))
    }

    /// All messages.
    pub(super) fn stream(self) -> impl Stream<Item = Result<Bytes, Status>> + Send {
        stream::unfold(Some(self), |answers| async {
            let mut answers = answers?;
            match answers.next().await {
                Ok(Some(message)) => Some((Ok(message), Some(answers))),
                Ok(None) => None,
                Err(status) => Some((Err(status), None)),
            }
        })
    }

    fn complete(&mut self) -> Option<Bytes> {
        let mut header = self.arrived.get(1..HEADER_BYTES)?;
        let length = header.get_u32() as usize;
        if self.arrived.len() - HEADER_BYTES < length {
            return None;
        }
        self.arrived.advance(HEADER_BYTES);
        Some(self.arrived.split_to(length).freeze())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answers(chunks: Vec<Bytes>) -> Answers {
        let chunks = chunks.into_iter().map(Ok::<_, std::convert::Infallible>);
        Answers {
            body: Body::from_stream(stream::iter(chunks)),
            arrived: BytesMut::new(),
        }
    }

    #[tokio::test]
    async fn messages_are_found_wherever_chunks_end() {
        let (one, two) = (framed(b"one").expect("short"), framed(b"").expect("short"));
        let all = [one, two].concat();
        for size in 1..all.len() {
            let chunks = all.chunks(size).map(Bytes::copy_from_slice).collect();
            let mut answers = answers(chunks);
            let first = answers.next().await.expect("a message");
            assert_eq!(first.as_deref(), Some(b"one".as_slice()));
            let second = answers.next().await.expect("a message");
            assert_eq!(second.as_deref(), Some(b"".as_slice()));
            assert_eq!(answers.next().await.expect("an end"), None);
        }
    }

    #[tokio::test]
    async fn an_answer_that_breaks_off_is_an_error() {
        let one = framed(b"one").expect("short");
        let broken = answers(vec![one.slice(..6)]);
        broken.single().await.expect_err("it breaks off");
        let none = answers(Vec::new());
        none.single().await.expect_err("there is none");
    }
}
