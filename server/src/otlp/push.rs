//! The task that sends.

use super::attributes::{nanos, resource, scope};
use super::figures::{Period, metrics};
use super::spans;
use super::wire::Wire;
use crate::config::OtlpConfig;
use crate::context::Context;
use crate::notify::EndedJobs;
use crate::pages::figures;
use opentelemetry_proto::tonic::collector::metrics::v1::ExportMetricsServiceRequest;
use opentelemetry_proto::tonic::collector::metrics::v1::metrics_service_client::MetricsServiceClient;
use opentelemetry_proto::tonic::collector::trace::v1::ExportTraceServiceRequest;
use opentelemetry_proto::tonic::collector::trace::v1::trace_service_client::TraceServiceClient;
use opentelemetry_proto::tonic::metrics::v1::{ResourceMetrics, ScopeMetrics};
use opentelemetry_proto::tonic::resource::v1::Resource;
use opentelemetry_proto::tonic::trace::v1::{ResourceSpans, ScopeSpans};
use std::fmt;
use std::future::Future;
use std::sync::Arc;
use std::time::Duration;
use thiserror::Error;
use tokio::time::{Instant, MissedTickBehavior, interval_at, timeout};
use tokio_util::sync::CancellationToken;
use tonic::transport::Channel;
use tonic::{Code, Request, Response, Status};
use yoto_process::metrics::METRICS;
use yoto_proto::names::Collection;
use yoto_proto::retry::{FailureCause, failure_cause};

/// Time limit of a call.
const PATIENCE: Duration = Duration::from_secs(10);
/// Jobs of one call.
const BATCH: usize = 64;

/// Why a call has failed.
#[derive(Debug, Error)]
enum PushError {
    #[error("{0}")]
    Store(#[from] yoto_store::StoreError),
    #[error("{0}")]
    Figures(#[from] fmt::Error),
    #[error("{}", told(.0))]
    Call(Status),
    #[error("the collector does not answer within {} s", PATIENCE.as_secs())]
    Late,
    #[error("the coordinator is ending")]
    Ending,
    #[error("the collector has refused {number} of them: {why}")]
    Partly { number: i64, why: String },
}

/// The status with the innermost cause: that of tonic is "transport error".
fn told(status: &Status) -> String {
    let mut cause = std::error::Error::source(status);
    let mut innermost = None;
    while let Some(error) = cause {
        innermost = Some(error.to_string());
        cause = error.source();
    }
    let message = innermost.unwrap_or_else(|| status.message().to_owned());
    format!("{:?}: {message}", status.code())
}

impl PushError {
    /// Whether the same call would fail again, as OTLP has it. Broken connections have other codes.
    fn is_final(&self) -> bool {
        match self {
            // OTLP lets a client repeat a call after OUT_OF_RANGE.
            Self::Call(status) => {
                let code = status.code();
                code != Code::OutOfRange && failure_cause(code) == FailureCause::Call
            }
            // The rest was accepted.
            Self::Partly { .. } => true,
            _ => false,
        }
    }
}

/// Sends every [`OtlpConfig::interval`] until the coordinator stops, and once more then.
pub(crate) async fn run(
    context: Arc<Context>,
    config: OtlpConfig,
    wire: Wire,
    ended: Arc<EndedJobs>,
) {
    let last = context.config.shutdown_grace / 2;
    let mut ticks = interval_at(Instant::now() + config.interval, config.interval);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut push = Push {
        channel: wire.channel(),
        resource: resource(&context.data_dir.instance),
        started: nanos(context.started),
        metrics: Signal::new("figures"),
        traces: Signal::new("traces"),
        stop: context.stop.clone(),
        context,
        config,
        wire,
        ended,
    };
    loop {
        tokio::select! {
            () = push.context.stop.cancelled() => break,
            _ = ticks.tick() => push.all().await,
        }
    }
    push.stop = CancellationToken::new();
    let sent = timeout(last, push.all()).await;
    let left = push.ended.len();
    if sent.is_err() || left > 0 {
        tracing::warn!(traces = left, "the last figures or traces were not sent");
    }
}

struct Push {
    context: Arc<Context>,
    config: OtlpConfig,
    wire: Wire,
    channel: Channel,
    resource: Resource,
    /// When the counters began, nanoseconds since 1970.
    started: u64,
    metrics: Signal,
    traces: Signal,
    /// Ends calls.
    stop: CancellationToken,
    ended: Arc<EndedJobs>,
}

impl Push {
    async fn all(&mut self) {
        let sent = self.send_figures().await;
        self.note(sent, |it| &mut it.metrics);
        while self.ended.len() > 0 {
            match self.send_traces().await {
                // Nothing was to be sent, which says nothing about the collector.
                Ok(0) => {}
                Ok(_) => self.note(Ok(()), |it| &mut it.traces),
                Err(fault) => {
                    self.note(Err(fault), |it| &mut it.traces);
                    break;
                }
            }
        }
    }

    /// Logs what is news. After a failure the next call has a connection of its own: one whose peer was lost would only
    /// fail after minutes.
    fn note(&mut self, sent: Result<(), PushError>, signal: impl FnOnce(&mut Self) -> &mut Signal) {
        if sent.is_err() {
            self.channel = self.wire.channel();
        }
        signal(self).note(sent);
    }

    async fn send_figures(&self) -> Result<(), PushError> {
        let rows = figures::read_now(&self.context).await;
        let period = Period {
            start: self.started,
            now: nanos(self.context.config.clock.time()).max(self.started),
        };
        let mut sent = metrics(METRICS.registry(), period)?;
        sent.extend(metrics(&rows, period)?);
        let body = ExportMetricsServiceRequest {
            resource_metrics: vec![ResourceMetrics {
                resource: Some(self.resource.clone()),
                scope_metrics: vec![ScopeMetrics {
                    scope: Some(scope()),
                    metrics: sent,
                    ..ScopeMetrics::default()
                }],
                ..ResourceMetrics::default()
            }],
        };
        let mut client = MetricsServiceClient::new(self.channel.clone());
        let answer = self.call(client.export(self.request(body))).await?;
        let refused = answer.partial_success.unwrap_or_default();
        accepted(refused.rejected_data_points, refused.error_message)
    }

    /// Sends the oldest ended jobs and returns how many they were. They stay in the queue if a later call may succeed.
    async fn send_traces(&self) -> Result<usize, PushError> {
        let jobs = self.ended.take(BATCH);
        let number = jobs.len();
        let taken = Taken {
            ended: &self.ended,
            jobs,
        };
        let sent = self.send_spans(&taken.jobs).await;
        match &sent {
            Ok(_) => taken.done(),
            Err(fault) if fault.is_final() => {
                taken.done();
                METRICS.traces_dropped(number);
            }
            Err(_) => {}
        }
        sent
    }

    /// Sends those of the jobs that have ended, and returns their number.
    async fn send_spans(&self, jobs: &[String]) -> Result<usize, PushError> {
        let ids = jobs.iter().filter_map(|it| Collection::Jobs.parse(it).ok());
        let ids: Vec<&str> = ids.collect();
        let jobs = self.context.store.ended_jobs(&ids).await?;
        if jobs.is_empty() {
            return Ok(0);
        }
        let body = ExportTraceServiceRequest {
            resource_spans: vec![ResourceSpans {
                resource: Some(self.resource.clone()),
                scope_spans: vec![ScopeSpans {
                    scope: Some(scope()),
                    spans: jobs.iter().flat_map(spans::of).collect(),
                    ..ScopeSpans::default()
                }],
                ..ResourceSpans::default()
            }],
        };
        let mut client = TraceServiceClient::new(self.channel.clone());
        let answer = self.call(client.export(self.request(body))).await?;
        let refused = answer.partial_success.unwrap_or_default();
        accepted(refused.rejected_spans, refused.error_message)?;
        Ok(jobs.len())
    }

    fn request<T>(&self, body: T) -> Request<T> {
        let mut request = Request::new(body);
        *request.metadata_mut() = self.config.headers.metadata().clone();
        request
    }

    async fn call<T>(
        &self,
        call: impl Future<Output = Result<Response<T>, Status>>,
    ) -> Result<T, PushError> {
        tokio::select! {
            () = self.stop.cancelled() => Err(PushError::Ending),
            answer = timeout(PATIENCE, call) => match answer {
                Ok(answer) => answer.map(Response::into_inner).map_err(PushError::Call),
                Err(_) => Err(PushError::Late),
            },
        }
    }
}

fn accepted(refused: i64, why: String) -> Result<(), PushError> {
    match refused {
        0 => Ok(()),
        number => Err(PushError::Partly { number, why }),
    }
}

/// Jobs that go back into the queue unless their traces were sent.
struct Taken<'a> {
    ended: &'a EndedJobs,
    jobs: Vec<String>,
}

impl Taken<'_> {
    fn done(mut self) {
        self.jobs.clear();
    }
}

impl Drop for Taken<'_> {
    fn drop(&mut self) {
        self.ended.put_back(std::mem::take(&mut self.jobs));
    }
}

/// Whether what is sent arrives: the log has a line when that changes.
struct Signal {
    what: &'static str,
    fails: bool,
}

impl Signal {
    fn new(what: &'static str) -> Self {
        Self { what, fails: false }
    }

    fn note(&mut self, sent: Result<(), PushError>) {
        let what = self.what;
        match sent {
            Err(PushError::Ending) => {}
            Err(error) if !self.fails => {
                self.fails = true;
                tracing::warn!(what, %error, "the collector of OTLP does not take what is sent");
            }
            Ok(()) if self.fails => {
                self.fails = false;
                tracing::info!(what, "the collector of OTLP takes what is sent again");
            }
            _ => {}
        }
    }
}
