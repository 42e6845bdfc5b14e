//! A collector of OpenTelemetry with real gRPC, which keeps what it gets.

use crate::support::eventually;
use opentelemetry_proto::tonic::collector::metrics::v1::metrics_service_server::{
    MetricsService, MetricsServiceServer,
};
use opentelemetry_proto::tonic::collector::metrics::v1::{
    ExportMetricsServiceRequest, ExportMetricsServiceResponse,
};
use opentelemetry_proto::tonic::collector::trace::v1::trace_service_server::{
    TraceService, TraceServiceServer,
};
use opentelemetry_proto::tonic::collector::trace::v1::{
    ExportTraceServiceRequest, ExportTraceServiceResponse,
};
use opentelemetry_proto::tonic::common::v1::KeyValue;
use opentelemetry_proto::tonic::common::v1::any_value::Value;
use opentelemetry_proto::tonic::metrics::v1::Metric;
use opentelemetry_proto::tonic::trace::v1::Span;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};
use tokio::net::TcpListener;
use tokio_stream::wrappers::TcpListenerStream;
use tonic::metadata::MetadataMap;
use tonic::transport::Server;
use tonic::{Code, Request, Response, Status};

/// What the collector got, and how it answers.
#[derive(Debug, Default)]
pub(super) struct Got {
    pub figures: Vec<ExportMetricsServiceRequest>,
    pub traces: Vec<ExportTraceServiceRequest>,
    /// The headers of the newest call.
    pub headers: MetadataMap,
    /// The refusal of traces, if they are refused.
    pub refusal: Option<Code>,
    /// Traces that were refused.
    pub refused: Vec<ExportTraceServiceRequest>,
}

#[derive(Debug, Clone, Default)]
pub(super) struct Collector(Arc<Mutex<Got>>);

impl Collector {
    /// A collector and its address.
    pub(super) async fn start() -> (Self, SocketAddr) {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let address = listener.local_addr().expect("has one");
        (Self::serve(listener), address)
    }

    pub(super) fn serve(listener: TcpListener) -> Self {
        let collector = Self::default();
        let serving = Server::builder()
            .add_service(MetricsServiceServer::new(collector.clone()))
            .add_service(TraceServiceServer::new(collector.clone()))
            .serve_with_incoming(TcpListenerStream::new(listener));
        tokio::spawn(serving);
        collector
    }

    pub(super) fn with<T>(&self, work: impl FnOnce(&mut Got) -> T) -> T {
        work(&mut self.0.lock().expect("nobody panicked"))
    }

    /// The newest figure called `name`, once `is_right` accepts it.
    pub(super) async fn figure(&self, name: &str, is_right: impl Fn(&Metric) -> bool) -> Metric {
        eventually(name, || async {
            let newest = self.with(|got| got.figures.last().cloned())?;
            let metrics = metrics(&newest);
            let found = metrics.into_iter().find(|it| it.name == name);
            found.filter(|it| is_right(it))
        })
        .await
    }

    /// The spans of the newest trace of `job`, once there is one.
    pub(super) async fn trace(&self, job: &str) -> Vec<Span> {
        eventually(job, || async { self.found(job) }).await
    }

    /// The spans of the newest trace of `job`, if it has arrived.
    pub(super) fn found(&self, job: &str) -> Option<Vec<Span>> {
        let spans: Vec<Span> = self.with(|got| got.traces.iter().flat_map(spans).collect());
        let id = spans.iter().rfind(|it| is_of(it, job))?.trace_id.clone();
        Some(spans.into_iter().filter(|it| it.trace_id == id).collect())
    }

    /// Waits until a trace of `job` was refused at least `times` times.
    pub(super) async fn refused(&self, job: &str, times: usize) {
        let refused = || async {
            let names_it = |it: &&ExportTraceServiceRequest| spans(it).any(|it| is_of(&it, job));
            let calls = self.with(|got| got.refused.iter().filter(names_it).count());
            (calls >= times).then_some(())
        };
        eventually("a refusal", refused).await;
    }
}

/// Whether the span is the root of `job`.
fn is_of(span: &Span, job: &str) -> bool {
    attribute(&span.attributes, "yoto.job") == job
}

/// All spans of a call.
fn spans(call: &ExportTraceServiceRequest) -> impl Iterator<Item = Span> {
    let scopes = call.resource_spans.iter().flat_map(|it| &it.scope_spans);
    scopes.flat_map(|it| it.spans.clone())
}

/// All figures of a call.
pub(super) fn metrics(call: &ExportMetricsServiceRequest) -> Vec<Metric> {
    let scopes = call
        .resource_metrics
        .iter()
        .flat_map(|it| &it.scope_metrics);
    scopes.flat_map(|it| it.metrics.clone()).collect()
}

/// The text or number of an attribute; empty without one.
pub(super) fn attribute(attributes: &[KeyValue], key: &str) -> String {
    let found = attributes.iter().find(|it| it.key == key);
    let value = found.and_then(|it| it.value.clone()?.value);
    match value {
        Some(Value::StringValue(text)) => text,
        Some(Value::IntValue(number)) => number.to_string(),
        _ => String::new(),
    }
}

#[tonic::async_trait]
impl MetricsService for Collector {
    async fn export(
        &self,
        request: Request<ExportMetricsServiceRequest>,
    ) -> Result<Response<ExportMetricsServiceResponse>, Status> {
        self.with(|got| {
            got.headers = request.metadata().clone();
            got.figures.push(request.into_inner());
        });
        Ok(Response::new(ExportMetricsServiceResponse::default()))
    }
}

#[tonic::async_trait]
impl TraceService for Collector {
    async fn export(
        &self,
        request: Request<ExportTraceServiceRequest>,
    ) -> Result<Response<ExportTraceServiceResponse>, Status> {
        self.with(|got| match got.refusal {
            Some(code) => {
                got.refused.push(request.into_inner());
                Err(Status::new(code, "as the test says"))
            }
            None => {
                got.headers = request.metadata().clone();
                got.traces.push(request.into_inner());
                Ok(Response::new(ExportTraceServiceResponse::default()))
            }
        })
    }
}
