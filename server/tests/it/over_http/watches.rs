//! Streams over HTTP: a browser that comes again misses nothing, and a key that ends ends them.

use crate::dashboard::stage::Stage;
use crate::support::{Open, Service, ask_with, listen, listen_as};
use std::time::Duration;
use yoto_proto::v1::Scope;
use yoto_server::Admission;

const EVENTS: &str = "Accept: text/event-stream\r\n";

#[tokio::test]
async fn a_watch_goes_on_after_the_last_event() {
    let stage = Stage::set().await;
    let (address, serving) = listen(&stage.service).await;
    let path = format!("/v1/{}:watch", stage.running);
    let mut first = Open::get(address, &path, EVENTS).await;
    let seen = first.until("data: ").await;
    assert!(seen.contains("content-type: text/event-stream"), "{seen}");
    assert!(seen.contains("\"state\":\"RUNNING\""), "{seen}");
    stage.report(40).await;
    let seen = first.until("\"fraction\":0.4").await;
    let last = seen.lines().rev().find_map(|it| it.strip_prefix("id: "));
    let again = format!("{EVENTS}Last-Event-ID: {}\r\n", last.expect("an id"));
    drop(first);
    stage.report(50).await;
    let mut second = Open::get(address, &path, &again).await;
    let seen = second.until("data: ").await;
    assert!(seen.contains("\"fraction\":0.5"), "nothing again: {seen}");
    serving.abort();
}

#[tokio::test]
async fn programs_get_a_line_for_each_answer() {
    let stage = Stage::set().await;
    let (address, _serving) = listen(&stage.service).await;
    let path = format!("/v1/{}:watch", stage.failed);
    let (status, head, text) = ask_with(address, "GET", &path, "", "").await;
    assert_eq!(status, 200);
    assert!(
        head.contains("content-type: application/x-ndjson"),
        "{head}"
    );
    let lines: Vec<serde_json::Value> = text
        .lines()
        .map(|line| serde_json::from_str(line).expect("JSON"))
        .collect();
    let last = lines.last().expect("a job");
    assert_eq!(last["job"]["state"], "FAILED", "it ends after its job");
    let (status, _, text) = ask_with(address, "GET", "/v1/jobs/none:watch", "", "").await;
    assert!(status == 404 && text.contains("NOT_FOUND"), "{text}");
}

#[tokio::test]
async fn a_revoked_key_ends_a_watch() {
    let service = Service::start().await;
    let key = service.key("default", &[Scope::Read]).await;
    let (address, _serving) = listen_as(&service, Admission::Nobody).await;
    let headers = format!(
        "{EVENTS}Connection: close\r\nAuthorization: Bearer {}\r\n",
        key.text
    );
    let job = service.ready_subject("Ada").await;
    let job = service.train(&service.model_of(&job).await).await;
    let path = format!("/v1/{}:watch", job.name);
    let mut watch = Open::get(address, &path, &headers).await;
    watch.until("data: ").await;
    service.revoke(&key.name).await;
    let ended = tokio::time::timeout(Duration::from_secs(20), watch.ended()).await;
    ended.expect("it ends");
}
