//! Pages over plain HTTP beside gRPC: whether the coordinator lives, whether it can serve, and its figures.

use crate::support::{Service, ask, eventually, listen};
use std::collections::HashSet;
use std::net::SocketAddr;
use std::time::Duration;
use tonic::transport::Endpoint;
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;
use yoto_server::ServerConfig;

async fn get(address: SocketAddr, path: &str) -> (u16, String) {
    let (status, _, body) = ask(address, "GET", path).await;
    (status, body)
}

#[tokio::test]
async fn pages_answer_get_and_head_alone() {
    let service = Service::start().await;
    let (address, serving) = listen(&service).await;
    assert_eq!(get(address, "/healthz").await, (200, "alive\n".into()));
    assert_eq!(get(address, "/readyz").await, (200, "ready\n".into()));
    let (status, head, body) = ask(address, "HEAD", "/metrics").await;
    assert_eq!((status, body.as_str()), (200, ""));
    assert!(head.contains("openmetrics-text"), "{head}");
    assert_eq!(ask(address, "POST", "/readyz").await.0, 405);
    assert_eq!(get(address, "/nothing").await.0, 404);
    assert_eq!(get(address, "/yoto.v1.NoService/Get").await.0, 404);
    serving.abort();
}

#[tokio::test]
async fn a_coordinator_without_its_database_or_its_objects_is_not_ready() {
    let start = |config: &mut ServerConfig| config.health_interval = Duration::from_millis(20);
    let service = Service::start_with(start).await;
    let (address, serving) = listen(&service).await;
    let told = |status: u16, words: &'static str| async move {
        let wanted = || async {
            let answer = get(address, "/readyz").await;
            (answer.0 == status && answer.1.contains(words)).then_some(())
        };
        eventually(words, wanted).await;
    };
    let locked = service.database.lock_writes().await;
    told(503, "the database can't be written").await;
    assert_eq!(get(address, "/healthz").await.0, 200, "the process lives");
    locked.release().await;
    told(200, "ready").await;

    let objects = service.path("");
    let away = objects.with_file_name("away");
    std::fs::rename(&objects, &away).expect("moves");
    told(503, "the object store does not answer").await;
    let status = async |name: &str| {
        let mut health = HealthClient::new(service.channel.clone());
        let request = HealthCheckRequest {
            service: name.into(),
        };
        let answer = health.check(request).await.expect("answers");
        answer.into_inner().status()
    };
    // A busy machine may be late with a write, too, for a moment.
    let apart = || async {
        let uploads = status("yoto.v1.UploadService").await == ServingStatus::NotServing;
        let jobs = status("yoto.v1.JobService").await == ServingStatus::Serving;
        (uploads && jobs).then_some(())
    };
    eventually("only uploads and downloads suffer", apart).await;
    std::fs::rename(&away, &objects).expect("moves back");
    told(200, "ready").await;
    serving.abort();
}

#[tokio::test]
async fn a_coordinator_that_leaves_says_so_and_still_answers() {
    let service = Service::start().await;
    let (address, serving) = listen(&service).await;
    service.coordinator.leave();
    let (status, words) = get(address, "/readyz").await;
    assert_eq!(status, 503);
    assert!(words.contains("this coordinator is ending"), "{words}");
    service.subject("Ada").await;
    let mut health = HealthClient::new(service.channel.clone());
    let request = HealthCheckRequest::default();
    let not_serving = || {
        let (mut health, request) = (health.clone(), request.clone());
        async move {
            let answer = health.check(request).await.expect("answers").into_inner();
            (answer.status() == ServingStatus::NotServing).then_some(())
        }
    };
    eventually("NOT_SERVING", not_serving).await;
    health.check(request).await.expect("answers");
    serving.abort();
}

#[tokio::test]
async fn calls_of_grpc_go_on_beside_pages() {
    let service = Service::start().await;
    let (address, serving) = listen(&service).await;
    let endpoint = Endpoint::from_shared(format!("http://{address}")).expect("an address");
    let channel = endpoint.connect().await.expect("connects");
    let mut health = HealthClient::new(channel.clone());
    let known = health.check(HealthCheckRequest::default()).await;
    known.expect("answers");
    let mut unknown = tonic::client::Grpc::new(channel);
    unknown.ready().await.expect("is ready");
    let path = "/yoto.v1.NoService/Get".parse().expect("a path");
    let codec = tonic_prost::ProstCodec::<HealthCheckRequest, HealthCheckRequest>::default();
    let request = tonic::Request::new(HealthCheckRequest::default());
    let refused = unknown.unary(request, path, codec).await;
    let code = refused.expect_err("there is none").code();
    assert_eq!(code, tonic::Code::Unimplemented);
    serving.abort();
}

/// The value of the line that begins with `name`.
fn value(text: &str, name: &str) -> f64 {
    let line = text.lines().find(|it| {
        let rest = it.strip_prefix(name);
        rest.is_some_and(|rest| rest.starts_with(' '))
    });
    let value = line.and_then(|it| it.rsplit(' ').next()?.parse().ok());
    value.unwrap_or_else(|| panic!("{name} in {text}"))
}

#[tokio::test]
async fn figures_tell_the_queue_and_what_happened() {
    let service = Service::start().await;
    let (address, serving) = listen(&service).await;
    let subject = service.ready_subject("Ada").await;
    let model = service.model_of(&subject).await;
    service.train(&model).await;
    service.train(&model).await;
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("a training waits");
    service.publish(&lease, 3).await.expect("holds the lease");
    let queued = || async {
        let text = get(address, "/metrics").await.1;
        let running = value(&text, r#"yoto_jobs{kind="train",state="running"}"#);
        (running == 1.0).then_some(text)
    };
    let text = eventually("the training", queued).await;
    assert!(text.ends_with("# EOF\n"), "{text}");
    assert_eq!(
        value(&text, r#"yoto_jobs{kind="train",state="queued"}"#),
        1.0
    );
    assert_eq!(
        value(&text, r#"yoto_jobs{kind="render",state="queued"}"#),
        0.0
    );
    assert!(value(&text, r#"yoto_queue_oldest_seconds{kind="train"}"#) >= 0.0);
    assert_eq!(value(&text, "yoto_ready"), 1.0);
    // Counters are of the process, which has other services too.
    for counter in [
        r#"yoto_leases_total{kind="train"}"#,
        "yoto_commit_seconds_count",
        "yoto_checkpoint_bytes_total",
        "yoto_uploaded_bytes_total",
        "yoto_last_collection_timestamp_seconds",
        r#"yoto_calls_total{method="yoto.worker.v1.WorkerService/LeaseJob"}"#,
    ] {
        assert!(value(&text, counter) > 0.0, "{counter}");
    }
    assert!(value(&text, "yoto_disk_free_bytes") > 0.0);
    dashboard_shows_only(&text);
    serving.abort();
}

/// Names of samples in `text`.
fn names(text: &str) -> HashSet<&str> {
    let lines = text.lines().filter(|it| !it.starts_with('#'));
    lines.filter_map(|it| it.split(['{', ' ']).next()).collect()
}

/// Every figure that the dashboard names is exported.
fn dashboard_shows_only(text: &str) {
    let exported = names(text);
    let dashboard = include_str!("../../../deploy/grafana/yoto.json");
    let words = dashboard.split(|it: char| !it.is_ascii_alphanumeric() && it != '_');
    let shown: HashSet<&str> = words.filter(|it| it.starts_with("yoto_")).collect();
    assert!(shown.len() > 15, "{shown:?}");
    let missing: Vec<_> = shown.difference(&exported).collect();
    assert!(missing.is_empty(), "{missing:?} of {exported:?}");
}
