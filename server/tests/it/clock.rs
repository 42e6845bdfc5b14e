//! Steps of the clock: a clock that is set and a service that is down delete nothing, and delay nothing.

use crate::support::{Service, chunks, file, job_error, job_name};
use prost_types::Timestamp;
use std::sync::Arc;
use tempfile::TempDir;
use tonic::Code;
use yoto_proto::v1::{CancelJobRequest, CollectGarbageResponse};
use yoto_proto::worker::v1::end_job_request::Outcome;
use yoto_server::clock::ManualClock;

const HOUR: f64 = 3600.0;
const DAY: f64 = 24.0 * HOUR;
/// The folder of a worker that was lost.
const LOST: &str = "renders/somebody/3";

async fn start_in(dir: TempDir, clock: &Arc<ManualClock>) -> Service {
    let own = Arc::clone(clock);
    Service::start_in(dir, move |config| config.clock = own).await
}

/// A service with garbage and an upload with acknowledged bytes. Also returns the clock and the upload's name.
async fn start() -> (Service, Arc<ManualClock>, String) {
    let clock = Arc::new(ManualClock::at(1e9));
    let service = start_in(TempDir::new().expect("a folder"), &clock).await;
    let subject = service.subject("Ada").await;
    let files = [file("poses.json", b"{}"), file("a", b"0123456789")];
    let upload = service.open_upload(&subject.name, &files).await;
    let upload = upload.expect("is opened").name;
    let half = chunks(&upload, &files[1..]);
    service.write(half).await.expect("is acknowledged");
    service.put(&format!("{LOST}/000000.png"), b"lost").await;
    let found = service.collect(false, false).await;
    assert_eq!(ages(&found), [0.0]);
    (service, clock, upload)
}

fn ages(found: &CollectGarbageResponse) -> Vec<f64> {
    found.folders.iter().map(|it| it.age_seconds).collect()
}

/// Collects, and asserts that the upload is kept, and the garbage with an `age` in seconds.
async fn assert_kept(service: &Service, upload: &str, age: f64) {
    let found = service.collect(false, false).await;
    let told = ages(&found);
    assert!(
        told.len() == 1 && (told[0] - age).abs() < 0.01,
        "{told:?}, not {age}"
    );
    let kept = service.get_upload(upload).await.expect("is kept");
    assert_eq!(kept.committed_bytes, 10);
    assert!(service.has(LOST));
}

#[tokio::test]
async fn a_clock_that_is_set_makes_nothing_older() {
    let (service, clock, upload) = start().await;
    clock.set_ahead(2.0 * DAY);
    assert_kept(&service, &upload, 0.0).await;
    clock.advance(10.0 * HOUR);
    assert_kept(&service, &upload, 10.0 * HOUR).await;
    clock.advance(13.0 * HOUR);
    assert_kept(&service, &upload, 23.0 * HOUR).await;
    clock.advance(2.0 * HOUR);
    service.collect(false, false).await;
    let gone = service
        .get_upload(&upload)
        .await
        .expect_err("a day is over");
    assert_eq!(gone.code(), Code::NotFound);
    assert!(!service.has(LOST));
}

#[tokio::test]
async fn a_clock_that_is_set_back_keeps_nothing_until_it_has_caught_up() {
    let (service, clock, upload) = start().await;
    clock.advance(10.0 * HOUR);
    clock.set_ahead(-400.0 * DAY);
    // Stamps that are now in the future are set to the current time.
    assert_kept(&service, &upload, 0.0).await;
    clock.advance(15.0 * HOUR);
    assert_kept(&service, &upload, 15.0 * HOUR).await;
    clock.advance(10.0 * HOUR);
    service.collect(false, false).await;
    let gone = service.get_upload(&upload).await;
    assert_eq!(gone.expect_err("a day is over").code(), Code::NotFound);
    assert!(!service.has(LOST));
}

#[tokio::test]
async fn a_service_that_was_down_makes_nothing_older() {
    let (service, clock, upload) = start().await;
    clock.advance(HOUR);
    assert_kept(&service, &upload, HOUR).await;
    let dir = service.stop().await;
    clock.advance(3.0 * DAY);
    let service = start_in(dir, &clock).await;
    assert_kept(&service, &upload, HOUR).await;
}

#[tokio::test]
async fn a_postponed_job_waits_no_longer_because_the_clock_is_set_back() {
    let clock = Arc::new(ManualClock::at(1e9));
    let service = start_in(TempDir::new().expect("a folder"), &clock).await;
    let subject = service.subject("Ada").await;
    service.upload_good(&subject.name).await;
    let worker = service.worker(&["ingest"]).await;
    let lease = service.lease(&worker).await.expect("the ingest waits");
    service.collect(false, false).await;
    let full = Outcome::Postponed(job_error("MACHINE", "no space"));
    service.end(&lease, full).await.expect("is put off");
    clock.set_ahead(-DAY);
    service.collect(false, false).await;
    assert!(
        service.lease(&worker).await.is_none(),
        "a second is not over"
    );
    clock.advance(2.0);
    assert!(service.lease(&worker).await.is_some());
}

#[tokio::test]
async fn nothing_ends_before_it_began_because_the_clock_is_set_back() {
    let clock = Arc::new(ManualClock::at(1e9));
    let service = start_in(TempDir::new().expect("a folder"), &clock).await;
    let subject = service.ready_subject("Ada").await;
    let waiting = service.train(&service.model_of(&subject).await).await;
    let run = service.train(&service.model_of(&subject).await).await;
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the first training");
    let (leased, waiting) = match job_name(&lease) == run.name {
        true => (run.name, waiting.name),
        false => (waiting.name, run.name),
    };
    clock.set_ahead(-DAY);
    let checkpoint = service.publish(&lease, 3).await.expect("publishes");
    service.complete_training(&lease, &checkpoint).await;
    let request = CancelJobRequest {
        name: waiting.clone(),
        ..CancelJobRequest::default()
    };
    service
        .jobs()
        .cancel_job(request)
        .await
        .expect("is cancelled");
    for name in [leased, waiting] {
        let job = service.get_job(&name).await;
        let seconds = |time: Option<Timestamp>| time.map(|it| it.seconds);
        let (begin, end) = (seconds(job.create_time), seconds(job.end_time));
        assert!(begin.is_some() && end >= begin, "{job:?}");
        assert!(
            job.attempts
                .iter()
                .all(|it| seconds(it.end_time) >= seconds(it.begin_time)),
            "{job:?}"
        );
    }
}
