//! Delivers calls as the [`Faults`] decide.

use futures::future::BoxFuture;
use http_body_util::{BodyExt, Full};
use std::sync::Arc;
use std::task::{Context, Poll};
use tonic::Status;
use tonic::body::Body;
use tonic::codegen::http::{Request, Response};
use tower::{Layer, Service};
use yoto_process::faults::{Current, Delivery, Faults, Moment, reached};
use yoto_request::methods::is_unary;

/// Wraps the services of a coordinator.
#[derive(Debug, Clone)]
pub(super) struct FaultLayer(pub Arc<dyn Faults>);

impl<S> Layer<S> for FaultLayer {
    type Service = Faulty<S>;

    fn layer(&self, inner: S) -> Faulty<S> {
        Faulty {
            inner,
            faults: Arc::clone(&self.0),
        }
    }
}

/// Services whose calls are disturbed.
#[derive(Debug, Clone)]
pub(super) struct Faulty<S> {
    inner: S,
    faults: Arc<dyn Faults>,
}

impl<S> Service<Request<Body>> for Faulty<S>
where
    S: Service<Request<Body>, Response = Response<Body>> + Clone + Send + 'static,
    S::Future: Send,
{
    type Response = Response<Body>;
    type Error = S::Error;
    type Future = BoxFuture<'static, Result<Response<Body>, S::Error>>;

    fn poll_ready(&mut self, context: &mut Context<'_>) -> Poll<Result<(), S::Error>> {
        self.inner.poll_ready(context)
    }

    fn call(&mut self, request: Request<Body>) -> Self::Future {
        let path = request.uri().path();
        if !is_unary(path) {
            return Box::pin(self.inner.call(request));
        }
        let name = path.rsplit('/').next().unwrap_or_default().to_owned();
        let faults = Arc::clone(&self.faults);
        let delivery = faults.delivery(&name);
        // Only this service was polled until it was ready; its clone was not.
        let spare = self.inner.clone();
        let inner = std::mem::replace(&mut self.inner, spare);
        let call = Current { name, faults };
        Box::pin(call.clone().scope(deliver(inner, request, delivery, call)))
    }
}

/// Calls `inner` once for each delivery, and drops all answers but the last. A late copy arrives when the
/// caller may have made other calls already.
async fn deliver<S>(
    mut inner: S,
    request: Request<Body>,
    delivery: Delivery,
    call: Current,
) -> Result<Response<Body>, S::Error>
where
    S: Service<Request<Body>, Response = Response<Body>> + Clone + Send + 'static,
    S::Future: Send,
{
    let (head, body) = request.into_parts();
    let bytes = match body.collect().await {
        Ok(body) => body.to_bytes(),
        Err(status) => return Ok(status.into_http()),
    };
    let again = || Request::from_parts(head.clone(), Body::new(Full::new(bytes.clone())));
    for _ in 1..delivery.times {
        std::future::poll_fn(|context| inner.poll_ready(context)).await?;
        inner.call(again()).await?;
    }
    std::future::poll_fn(|context| inner.poll_ready(context)).await?;
    let answer = inner.call(again()).await?;
    if let Some(time) = delivery.late {
        let (mut inner, copy) = (inner, again());
        tokio::spawn(call.scope(async move {
            tokio::time::sleep(time).await;
            if std::future::poll_fn(|context| inner.poll_ready(context))
                .await
                .is_ok()
            {
                // Its answer has nowhere to go.
                drop(inner.call(copy).await);
            }
        }));
    }
    reached(Moment::BeforeReply);
    match delivery.answered {
        true => Ok(answer),
        false => Ok(Status::unavailable("the answer was lost on purpose").into_http()),
    }
}
