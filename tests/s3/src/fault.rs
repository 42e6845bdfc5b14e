//! Failures in front of the server.

use bytes::Bytes;
use futures::StreamExt;
use http_body_util::combinators::UnsyncBoxBody;
use http_body_util::{BodyExt, Full, StreamBody};
use hyper::body::{Body as _, Frame, Incoming};
use hyper::{Request, Response};
use s3s::service::S3Service;
use std::error::Error;
use std::io;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

type Failure = Box<dyn Error + Send + Sync>;
type Answer = Response<UnsyncBoxBody<Bytes, Failure>>;

/// A failure of every request, until it is over.
#[derive(Debug, Clone)]
pub enum S3Fault {
    /// 503 SlowDown.
    Unavailable,
    /// The connection ends after half of an answer's body. Every second request, so that who goes on gets through.
    CutAnswers,
    /// The connection ends within a request's body. Every second request with one.
    CutRequests,
    /// A request by a signed URL ends its connection: who has no other way does not reach the store.
    NoSigned,
    /// Each request waits.
    Slow(Duration),
    /// This status with this body, as from another server or another kind of refusal.
    Answer(u16, &'static str),
}

/// The current failure.
#[derive(Debug, Default)]
pub(crate) struct Faults {
    fault: Mutex<Option<S3Fault>>,
    failed: AtomicU64,
    requests: AtomicU64,
    signed: AtomicU64,
}

impl Faults {
    pub(crate) fn set(&self, fault: Option<S3Fault>) {
        *self.fault.lock().unwrap_or_else(PoisonError::into_inner) = fault;
    }

    /// Requests that failed by a fault.
    pub(crate) fn failed(&self) -> u64 {
        self.failed.load(Ordering::SeqCst)
    }

    /// Requests that came by signed URLs.
    pub(crate) fn signed(&self) -> u64 {
        self.signed.load(Ordering::SeqCst)
    }

    fn current(&self) -> Option<S3Fault> {
        self.fault
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    /// Answers a request by the `service`, unless it fails.
    pub(crate) async fn answer(
        &self,
        service: &S3Service,
        request: Request<Incoming>,
    ) -> io::Result<Answer> {
        let even = self
            .requests
            .fetch_add(1, Ordering::SeqCst)
            .is_multiple_of(2);
        let query = request.uri().query().unwrap_or_default();
        let is_signed = query.contains("X-Amz-Signature=");
        if is_signed {
            self.signed.fetch_add(1, Ordering::SeqCst);
        }
        let fail = || self.failed.fetch_add(1, Ordering::SeqCst);
        match self.current() {
            Some(S3Fault::Unavailable) => {
                fail();
                Ok(refusal(503, "<Error><Code>SlowDown</Code></Error>"))
            }
            Some(S3Fault::Answer(status, body)) => {
                fail();
                Ok(refusal(status, body))
            }
            Some(S3Fault::NoSigned) if is_signed => {
                fail();
                Err(io::ErrorKind::ConnectionReset.into())
            }
            Some(S3Fault::CutRequests) if even && !request.body().is_end_stream() => {
                fail();
                // Whatever has arrived of it.
                let _ = request.into_body().frame().await;
                Err(io::ErrorKind::ConnectionReset.into())
            }
            Some(S3Fault::CutAnswers) if even => {
                fail();
                half(pass(service, request).await?).await
            }
            Some(S3Fault::Slow(time)) => {
                fail();
                tokio::time::sleep(time).await;
                pass(service, request).await
            }
            _ => pass(service, request).await,
        }
    }
}

async fn pass(service: &S3Service, request: Request<Incoming>) -> io::Result<Answer> {
    let answered = service.call(request.map(s3s::Body::from)).await;
    let answered = answered.map_err(|error| io::Error::other(format!("{error:?}")))?;
    Ok(answered.map(|body| body.boxed_unsync()))
}

/// The answer with the length of the whole, which breaks off after half of it.
async fn half(answer: Answer) -> io::Result<Answer> {
    let (mut head, body) = answer.into_parts();
    let whole = body.collect().await.map_err(io::Error::other)?.to_bytes();
    head.headers
        .insert(hyper::header::CONTENT_LENGTH, whole.len().into());
    let begin = whole.slice(..whole.len() / 2);
    let broken: Failure = io::Error::from(io::ErrorKind::ConnectionReset).into();
    let frames = futures::stream::iter([Ok(Frame::data(begin)), Err(broken)]);
    // What was sent goes out before the connection ends.
    let frames = frames.then(|it| async {
        tokio::time::sleep(Duration::from_millis(20)).await;
        it
    });
    Ok(Response::from_parts(
        head,
        StreamBody::new(frames).boxed_unsync(),
    ))
}

fn refusal(status: u16, body: &'static str) -> Answer {
    let body = Full::new(Bytes::from_static(body.as_bytes())).map_err(|never| match never {});
    let mut answer = Response::new(body.boxed_unsync());
    *answer.status_mut() = hyper::StatusCode::from_u16(status).unwrap_or_default();
    answer
}
