//! Figures and traces as a collector of OpenTelemetry gets them.

mod collector;

use crate::support::{Service, job_error, job_name};
use collector::{Collector, attribute, metrics};
use opentelemetry_proto::tonic::metrics::v1::metric::Data;
use opentelemetry_proto::tonic::metrics::v1::number_data_point::Value;
use opentelemetry_proto::tonic::trace::v1::Span;
use opentelemetry_proto::tonic::trace::v1::status::StatusCode;
use sha2::{Digest, Sha256};
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tonic::{Code, Request};
use yoto_proto::hex;
use yoto_proto::v1::{
    CancelJobRequest, CreateJobRequest, Job, JobSpec, RetryJobRequest, TrainSpec, job_spec,
};
use yoto_proto::worker::v1::end_job_request::Outcome;
use yoto_server::clock::ManualClock;
use yoto_server::{OtlpConfig, ServerConfig};

/// Length of a lease, seconds.
const LEASE: f64 = 20.0;
const SECOND: u64 = 1_000_000_000;

fn sends_to(address: SocketAddr, config: &mut ServerConfig) {
    let endpoint = format!("http://{address}").parse().expect("an endpoint");
    config.otlp = Some(OtlpConfig {
        interval: Duration::from_millis(20),
        headers: "x-key=s%20ecret".parse().expect("headers"),
        ..OtlpConfig::new(endpoint)
    });
}

async fn start(address: SocketAddr) -> Service {
    Service::start_with(|config| sends_to(address, config)).await
}

async fn training(service: &Service) -> Job {
    let subject = service.ready_subject("Ada").await;
    let model = service.model_of(&subject).await;
    service.train(&model).await
}

/// A training that was ordered and cancelled.
async fn cancelled(service: &Service) -> Job {
    let job = training(service).await;
    let request = CancelJobRequest {
        name: job.name.clone(),
        ..CancelJobRequest::default()
    };
    service.jobs().cancel_job(request).await.expect("is heard");
    job
}

fn called<'a>(spans: &'a [Span], name: &str) -> Vec<&'a Span> {
    spans.iter().filter(|it| it.name == name).collect()
}

/// Code of a span's error; empty without one.
fn error(span: &Span) -> String {
    let status = span.status.clone().unwrap_or_default();
    let failed = status.code() == StatusCode::Error;
    assert_eq!(failed, !status.message.is_empty(), "{span:?}");
    assert_eq!(attribute(&span.attributes, "error.type"), status.message);
    status.message
}

#[tokio::test]
async fn figures_arrive_as_those_of_the_page_with_headers_and_the_instance() {
    let (collector, address) = Collector::start().await;
    let service = start(address).await;
    let job = training(&service).await;
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    assert_eq!(job_name(&lease), job.name);
    let running = |it: &opentelemetry_proto::tonic::metrics::v1::Metric| {
        let Some(Data::Gauge(gauge)) = &it.data else {
            panic!("{it:?} is no gauge");
        };
        let of = |point: &&opentelemetry_proto::tonic::metrics::v1::NumberDataPoint| {
            attribute(&point.attributes, "kind") == "train"
                && attribute(&point.attributes, "state") == "running"
        };
        let found = gauge.data_points.iter().find(of);
        found.is_some_and(|it| it.value == Some(Value::AsInt(1)))
    };
    let jobs = collector.figure("yoto_jobs", running).await;
    assert_eq!(
        jobs.description,
        "Open jobs of all tenants, by kind and state."
    );

    let leases = collector.figure("yoto_leases", |_| true).await;
    let Some(Data::Sum(leases)) = leases.data else {
        panic!("{leases:?} is no sum");
    };
    assert!(leases.is_monotonic);
    let point = &leases.data_points[0];
    assert!(point.start_time_unix_nano > 0 && point.start_time_unix_nano < point.time_unix_nano);
    let commits = collector.figure("yoto_commit_seconds", |_| true).await;
    assert_eq!(commits.unit, "s");
    let Some(Data::Histogram(commits)) = commits.data else {
        panic!("{commits:?} is no histogram");
    };
    let commits = &commits.data_points[0];
    assert_eq!(
        commits.bucket_counts.len(),
        commits.explicit_bounds.len() + 1
    );
    assert_eq!(commits.bucket_counts.iter().sum::<u64>(), commits.count);
    assert!(commits.count > 0 && commits.sum > Some(0.0));
    let size = collector.figure("yoto_uploaded_bytes", |_| true).await;
    assert_eq!(size.unit, "By");

    let (headers, newest) = collector.with(|got| (got.headers.clone(), got.figures.pop()));
    let key = headers.get("x-key").and_then(|it| it.to_str().ok());
    assert_eq!(key, Some("s ecret"));
    let resource = newest.expect("was sent").resource_metrics[0]
        .resource
        .clone();
    let resource = resource.expect("has one").attributes;
    let instance = std::fs::read_to_string(service.dir.path().join("instance"));
    assert_eq!(
        attribute(&resource, "service.instance.id"),
        instance.expect("is there").trim()
    );
    assert_eq!(attribute(&resource, "service.name"), "yoto");
    let version = attribute(&resource, "service.version");
    assert_eq!(version, env!("CARGO_PKG_VERSION"));
}

#[tokio::test]
async fn a_trace_tells_the_wait_a_lost_lease_and_the_success() {
    let (collector, address) = Collector::start().await;
    let clock = Arc::new(ManualClock::at(1e9));
    let own = clock.clone();
    let service = Service::start_with(move |config| {
        config.clock = own;
        config.lease_seconds = LEASE;
        sends_to(address, config);
    })
    .await;
    let subject = service.ready_subject("Ada").await;
    let model = service.model_of(&subject).await;
    let spec = job_spec::Kind::Train(TrainSpec {
        model: model.name.clone(),
        seconds: 1.0,
        ..TrainSpec::default()
    });
    let request = CreateJobRequest {
        spec: Some(JobSpec { kind: Some(spec) }),
        request_id: "the order".into(),
        ..CreateJobRequest::default()
    };
    let job = service.jobs().create_job(request).await.expect("is queued");
    let job = job.into_inner().name;
    let look = async |seconds: f64| {
        clock.advance(seconds);
        let looked = service.coordinator.look_after_leases().await;
        looked.expect("looks");
    };
    look(3.0).await;
    let lost = service.worker_called("lost", &["train"]).await;
    service.lease(&lost).await.expect("the training waits");
    // In steps too short for an outage.
    for _ in 0..5 {
        look(0.21 * LEASE).await;
    }
    let heir = service.worker_called("heir", &["train"]).await;
    let lease = service.lease(&heir).await.expect("waits again");
    look(2.0).await;
    assert_eq!(collector.found(&job), None, "it runs");
    let checkpoint = service.publish(&lease, 5).await.expect("publishes");
    service.complete_training(&lease, &checkpoint).await;

    let spans = collector.trace(&job).await;
    let seconds = |it: &Span| {
        let from_order = |at: u64| (at - 1_000_000_000 * SECOND + SECOND / 2) / SECOND;
        (
            from_order(it.start_time_unix_nano),
            from_order(it.end_time_unix_nano),
        )
    };
    let [root] = called(&spans, "train")[..] else {
        panic!("{spans:?}");
    };
    let told = |key| attribute(&root.attributes, key);
    assert_eq!(
        (told("yoto.job"), told("yoto.kind")),
        (job.clone(), "train".into())
    );
    assert_eq!(
        (told("yoto.outcome"), error(root)),
        ("SUCCEEDED".into(), String::new())
    );
    assert_eq!(told("yoto.request_id"), "the order");
    assert_eq!(
        (told("yoto.model"), told("yoto.lost_workers")),
        (model.name, "1".into())
    );
    assert_eq!(told("yoto.tenant"), "default");
    assert_eq!(root.trace_id, Sha256::digest(job.as_bytes())[..16]);
    assert!(root.parent_span_id.is_empty());
    let [queued] = called(&spans, "queued")[..] else {
        panic!("{spans:?}");
    };
    let attempts = called(&spans, "attempt");
    let outcomes = attempts.iter().map(|it| {
        let told = |key| attribute(&it.attributes, key);
        (
            told("yoto.attempt"),
            told("yoto.worker_name"),
            told("yoto.outcome"),
            error(it),
        )
    });
    let outcomes: Vec<_> = outcomes.collect();
    let expected = [
        ("1", "lost", "LOST", "WORKER_LOST"),
        ("2", "heir", "SUCCEEDED", ""),
    ];
    let expected = expected.map(|(a, b, c, d)| (a.into(), b.into(), c.into(), d.into()));
    assert_eq!(outcomes, expected);
    assert_eq!(attribute(&attempts[1].attributes, "yoto.worker"), heir);
    assert_eq!(seconds(root), (0, 26));
    assert_eq!(seconds(queued), (0, 3));
    assert_eq!(seconds(attempts[0]), (3, 24));
    assert_eq!(seconds(attempts[1]), (24, 26));
    for child in spans.iter().filter(|it| it.span_id != root.span_id) {
        assert_eq!(child.parent_span_id, root.span_id);
    }
    let mut ids: Vec<_> = spans.iter().map(|it| it.span_id.clone()).collect();
    ids.sort();
    ids.dedup();
    assert_eq!(ids.len(), 4);
}

#[tokio::test]
async fn a_failed_and_a_cancelled_job_have_traces() {
    let (collector, address) = Collector::start().await;
    let service = start(address).await;
    let job = training(&service).await;
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    let diverged = Outcome::Failed(job_error("DIVERGED", "the loss of Ada"));
    service.end(&lease, diverged).await.expect("ends");
    let spans = collector.trace(&job.name).await;
    for name in ["train", "attempt"] {
        let [span] = called(&spans, name)[..] else {
            panic!("{spans:?}");
        };
        assert_eq!(error(span), "DIVERGED", "its message may name people");
    }
    let job = cancelled(&service).await;
    let spans = collector.trace(&job.name).await;
    let names: Vec<&str> = spans.iter().map(|it| it.name.as_str()).collect();
    assert_eq!(names, ["train", "queued"]);
    assert_eq!(attribute(&spans[0].attributes, "yoto.outcome"), "CANCELLED");
    assert_eq!(spans[0].end_time_unix_nano, spans[1].end_time_unix_nano);
}

#[tokio::test]
async fn what_a_collector_missed_arrives_when_it_is_back() {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let service = start(listener.local_addr().expect("has one")).await;
    let job = cancelled(&service).await;
    // It breaks connections off.
    for _ in 0..5 {
        listener.accept().await.expect("comes");
    }
    let collector = Collector::serve(listener);
    collector.trace(&job.name).await;
    collector.figure("yoto_ready", |_| true).await;

    // It is there, and can't take traces for now.
    collector.with(|got| got.refusal = Some(Code::Unavailable));
    let job = cancelled(&service).await;
    collector.refused(&job.name, 2).await;
    collector.with(|got| got.refusal = None);
    collector.trace(&job.name).await;
}

#[tokio::test]
async fn what_a_collector_refuses_for_good_is_not_sent_again() {
    let (collector, address) = Collector::start().await;
    collector.with(|got| got.refusal = Some(Code::Unimplemented));
    let service = start(address).await;
    let refused = cancelled(&service).await;
    collector.refused(&refused.name, 1).await;
    collector.with(|got| got.refusal = None);
    let job = cancelled(&service).await;
    collector.trace(&job.name).await;
    assert_eq!(collector.found(&refused.name), None);
    let dropped = collector.figure("yoto_traces_dropped", |it| match &it.data {
        Some(Data::Sum(sum)) => sum.data_points[0].value != Some(Value::AsInt(0)),
        _ => false,
    });
    dropped.await;
}

#[tokio::test]
async fn the_last_figures_and_traces_are_sent_at_the_end() {
    let (collector, address) = Collector::start().await;
    let service = Service::start_with(|config| {
        sends_to(address, config);
        let otlp = config.otlp.as_mut().expect("was set");
        otlp.interval = Duration::from_secs(3600);
    })
    .await;
    let job = cancelled(&service).await;
    assert_eq!(collector.found(&job.name), None, "an hour has not passed");
    service.stop().await;
    assert!(collector.found(&job.name).is_some());
    let figures = collector.with(|got| got.figures.clone());
    assert_eq!(figures.len(), 1);
    assert!(metrics(&figures[0]).len() > 15);
}

#[tokio::test]
async fn a_job_of_a_caller_with_a_trace_belongs_to_that_trace() {
    let (collector, address) = Collector::start().await;
    let service = start(address).await;
    let subject = service.ready_subject("Ada").await;
    let model = service.model_of(&subject).await;
    let order = || {
        let spec = job_spec::Kind::Train(TrainSpec {
            model: model.name.clone(),
            seconds: 1.0,
            ..TrainSpec::default()
        });
        Request::new(CreateJobRequest {
            spec: Some(JobSpec { kind: Some(spec) }),
            ..CreateJobRequest::default()
        })
    };
    let (trace, span) = ("4bf92f3577b34da6a3ce929d0e0e4736", "00f067aa0ba902b7");
    let fail = async |job: &str| {
        let worker = service.worker(&["train"]).await;
        let lease = service.lease(&worker).await.expect("the training waits");
        let diverged = Outcome::Failed(job_error("DIVERGED", "the loss"));
        service.end(&lease, diverged).await.expect("ends");
        collector.trace(job).await
    };
    let belongs = |spans: &[Span]| {
        let [root] = called(spans, "train")[..] else {
            panic!("{spans:?}");
        };
        assert_eq!(spans.len(), 3);
        assert!(spans.iter().all(|it| hex(&it.trace_id) == trace));
        assert_eq!(hex(&root.parent_span_id), span);
    };

    let mut told = order();
    let header = format!("00-{trace}-{span}-01").parse().expect("ASCII");
    told.metadata_mut().insert("traceparent", header);
    let first = service.jobs().create_job(told).await.expect("is queued");
    let first = first.into_inner().name;
    belongs(&fail(&first).await);

    let mut again = Request::new(RetryJobRequest {
        name: first,
        ..RetryJobRequest::default()
    });
    let later = "4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7";
    let header = format!("01-{later}-00-more").parse().expect("ASCII");
    again.metadata_mut().insert("traceparent", header);
    let second = service.jobs().retry_job(again).await.expect("is queued");
    let second = second.into_inner().name;
    // The trace has both jobs.
    let spans = fail(&second).await;
    let of_caller = spans.iter().filter(|it| hex(&it.parent_span_id) == span);
    assert_eq!((spans.len(), of_caller.count()), (6, 2));

    let mut broken = order();
    let header = "00-trace-span-01".parse().expect("ASCII");
    broken.metadata_mut().insert("traceparent", header);
    let third = service.jobs().create_job(broken).await;
    let third = third.expect("is queued nevertheless").into_inner().name;
    let spans = fail(&third).await;
    let own = Sha256::digest(third.as_bytes());
    assert!(spans.iter().all(|it| it.trace_id == own[..16]));
}
