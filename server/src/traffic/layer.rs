//! Applies the limits to each call. Tower's own limits release a call when its response begins; a stream of responses
//! would not count.

use super::held::Held;
use super::incoming::Incoming;
use super::{Call, Client, Traffic, busy};
use crate::access::{brings_file, is_probe};
use futures::future::BoxFuture;
use http_body_util::BodyExt;
use std::sync::Arc;
use std::task::{Context, Poll};
use tonic::Status;
use tonic::body::Body;
use tonic::codegen::http::header::HOST;
use tonic::codegen::http::{Request, Response, StatusCode, Version};
use tower::{Layer, Service};
use yoto_http::{is_grpc, transcoding};
use yoto_process::metrics::METRICS;
use yoto_request::methods::{self, is_unary};

/// Wraps the services of a listener.
#[derive(Debug, Clone)]
pub(crate) struct TrafficLayer(pub Arc<Traffic>);

impl<S> Layer<S> for TrafficLayer {
    type Service = Limited<S>;

    fn layer(&self, inner: S) -> Limited<S> {
        Limited {
            inner,
            traffic: Arc::clone(&self.0),
        }
    }
}

/// Services whose calls are counted.
#[derive(Debug, Clone)]
pub(crate) struct Limited<S> {
    inner: S,
    traffic: Arc<Traffic>,
}

/// The refusal of a page.
fn plain(message: &str) -> Response<Body> {
    yoto_http::text(StatusCode::SERVICE_UNAVAILABLE, message)
}

/// Whether nothing in the request tells for whom it is (RFC 9112, 3.2).
fn is_without_host(request: &Request<Body>) -> bool {
    request.version() == Version::HTTP_11
        && !request.headers().contains_key(HOST)
        && request.uri().authority().is_none()
}

impl<S> Service<Request<Body>> for Limited<S>
where
    S: Service<Request<Body>, Response = Response<Body>>,
    S::Future: Send + 'static,
    S::Error: Send + 'static,
{
    type Response = Response<Body>;
    type Error = S::Error;
    type Future = BoxFuture<'static, Result<Response<Body>, S::Error>>;

    fn poll_ready(&mut self, context: &mut Context<'_>) -> Poll<Result<(), S::Error>> {
        self.inner.poll_ready(context)
    }

    fn call(&mut self, request: Request<Body>) -> Self::Future {
        if is_without_host(&request) {
            let told = "a request of HTTP/1.1 has the header Host";
            let refused = yoto_http::text(StatusCode::BAD_REQUEST, told);
            return Box::pin(std::future::ready(Ok(refused)));
        }
        let traffic = Arc::clone(&self.traffic);
        let limits = &traffic.limits;
        let place = Arc::clone(&traffic.calls).try_acquire_owned().ok();
        // A probe is answered from memory at once, whatever others hold.
        if place.is_none() && !is_probe(request.uri().path()) {
            METRICS.refused();
            let message = format!("{} calls are open already", limits.calls);
            let refused = match is_grpc(request.headers()) {
                true => Status::from(busy(message)).into_http(),
                false => plain(&message),
            };
            return Box::pin(std::future::ready(Ok(refused)));
        }
        let client = request.extensions().get::<Arc<Client>>().cloned();
        let call = Arc::new(Call::begin(Arc::clone(&traffic), client, place));
        let longest = limits.call;
        let grpc = is_grpc(request.headers());
        let (verb, path) = (request.method(), request.uri().path());
        // A page is one answer too.
        let unary = match grpc {
            true => is_unary(path),
            false => !transcoding::streams(verb, path) && !brings_file(verb, path),
        };
        let held = Arc::<Held>::default();
        let (mut parts, body) = request.into_parts();
        parts.extensions.insert(Arc::clone(&call));
        let kind = methods::request(parts.uri.path());
        if kind.is_some() {
            METRICS.called(parts.uri.path());
        }
        let incoming = Incoming::new(
            body,
            traffic,
            Arc::clone(&call),
            Arc::clone(&held),
            unary,
            grpc,
            kind,
        );
        let request = Request::from_parts(parts, incoming.into_body());
        let answer = self.inner.call(request);
        Box::pin(async move {
            let answer = if unary {
                match tokio::time::timeout(longest, answer).await {
                    Ok(answer) => answer?,
                    Err(_) => {
                        let message = format!("the call took longer than {} s", longest.as_secs());
                        return Ok(match grpc {
                            true => Status::deadline_exceeded(message).into_http(),
                            false => plain(&message),
                        });
                    }
                }
            } else {
                answer.await?
            };
            drop(held);
            // A stream of responses counts until it ends.
            Ok(answer.map(|body| {
                Body::new(body.map_frame(move |frame| {
                    let _open = &call;
                    frame
                }))
            }))
        })
    }
}
