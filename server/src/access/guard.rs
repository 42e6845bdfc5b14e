//! Ends the streams of a caller who may no longer call.

use super::{Admission, Callers};
use crate::access::keys::FRESH;
use bytes::Bytes;
use futures::FutureExt;
use futures::future::Shared;
use http_body::{Frame, SizeHint};
use std::future::Future;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{self, Poll, ready};
use tonic::Status;
use tonic::body::Body;
use tonic::codegen::http::HeaderMap;
use yoto_request::RequestError;

/// The end of a caller's right, as an answer. The request and the answer of a stream wait for it.
pub(super) type Ended = Shared<Pin<Box<dyn Future<Output = Status> + Send>>>;

/// Ready once the caller with the key of this SHA-256 may not call any more; without a key, once one is asked for. Looks at every
/// change by this process, and at those of others every [`FRESH`]: a key that another coordinator has revoked ends a stream
/// after at most twice that time and a read.
pub(super) fn ended(callers: Arc<Callers>, admission: Admission, sha256: Option<String>) -> Ended {
    let ended: Pin<Box<dyn Future<Output = Status> + Send>> = Box::pin(async move {
        let mut changes = callers.ring.changes();
        loop {
            tokio::select! {
                () = tokio::time::sleep(FRESH) => {}
                // The ring of keys has the sender.
                _ = changes.changed() => {}
            }
            let keys = match callers.keys().await {
                Ok(keys) => keys,
                Err(error) => return RequestError::from(error).into(),
            };
            let still = match &sha256 {
                Some(sha256) => keys.find(sha256).map(drop),
                None => admission.without_key(&keys, callers.at_issuer),
            };
            if let Err(error) = still {
                return error.into();
            }
        }
    });
    ended.shared()
}

/// The body of a request that fails with the caller's right. What reads it may outlive the call: bytes that have come are committed when
/// a caller disconnects.
pub(super) struct GuardedRequest {
    inner: Body,
    ended: Ended,
}

impl GuardedRequest {
    /// `inner`, until `ended`.
    pub(super) fn new(inner: Body, ended: Ended) -> Self {
        Self { inner, ended }
    }
}

impl http_body::Body for GuardedRequest {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut task::Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
        if let Poll::Ready(status) = Pin::new(&mut self.ended).poll(context) {
            return Poll::Ready(Some(Err(status)));
        }
        Pin::new(&mut self.inner).poll_frame(context)
    }

    fn is_end_stream(&self) -> bool {
        self.inner.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.inner.size_hint()
    }
}

/// A response that ends with the caller's right.
pub(super) struct Guarded {
    inner: Body,
    ended: Ended,
    over: bool,
}

impl Guarded {
    /// `inner`, until `ended`.
    pub(super) fn new(inner: Body, ended: Ended) -> Self {
        Self {
            inner,
            ended,
            over: false,
        }
    }
}

impl http_body::Body for Guarded {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut task::Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
        if self.over {
            return Poll::Ready(None);
        }
        if let Poll::Ready(status) = Pin::new(&mut self.ended).poll(context) {
            self.over = true;
            // What the stream holds goes with it.
            self.inner = Body::empty();
            let mut trailers = HeaderMap::new();
            return Poll::Ready(Some(match status.add_header(&mut trailers) {
                Ok(()) => Ok(Frame::trailers(trailers)),
                Err(status) => Err(status),
            }));
        }
        let frame = ready!(Pin::new(&mut self.inner).poll_frame(context));
        self.over = frame.is_none();
        Poll::Ready(frame)
    }

    fn is_end_stream(&self) -> bool {
        self.over || self.inner.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        SizeHint::default()
    }
}
