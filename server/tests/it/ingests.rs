//! Ingest jobs of uploads: what becomes of a capture when they fail, and how they are repeated.

use crate::support;
use crate::support::{Service, assert_refused, eventually};
use std::time::Duration;
use tonic::{Code, Status};
use yoto_proto::v1::{
    CancelJobRequest, Capture, IngestCaptureRequest, JobError, Violation, capture, job, subject,
};
use yoto_proto::worker::v1::Lease;
use yoto_proto::worker::v1::end_job_request::{Cancelled, Outcome};

#[tokio::test]
async fn a_rejected_capture_stays_visible_and_a_good_one_heals_the_subject() {
    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    let first = service.upload_good(&subject.name).await.name;
    let worker = service.worker(&["ingest"]).await;
    let lease = service.lease(&worker).await.expect("the ingest job waits");
    let violation = Violation {
        code: "NOT_FINITE".into(),
        file: "poses.json".into(),
        frame: Some(17),
        field: "pose[41]".into(),
        message: "NaN".into(),
    };
    let error = JobError {
        code: "REJECTED".into(),
        message: "poses".into(),
        violations: vec![violation.clone()],
    };
    let ended = service.end(&lease, Outcome::Failed(error.clone())).await;
    ended.expect("is recorded");
    let job = service.get_job(&support::job_name(&lease)).await;
    assert_eq!((job.state(), job.error), (job::State::Failed, Some(error)));
    let capture = service.get_capture(&first).await;
    assert_eq!(capture.state(), capture::State::Rejected);
    assert_eq!(capture.violations, [violation]);
    assert_eq!(
        service.get_subject(&subject.name).await.state(),
        subject::State::Rejected
    );

    let second = service.upload_good(&subject.name).await.name;
    assert_eq!(
        service.get_subject(&subject.name).await.state(),
        subject::State::Ingesting
    );
    let lease = service.lease(&worker).await.expect("the ingest job waits");
    service.complete_ingest(&lease).await;
    let healed = service.get_subject(&subject.name).await;
    assert_eq!(healed.state(), subject::State::Ready);
    assert_eq!(healed.captures, [first, second]);
}

#[tokio::test]
async fn a_fault_with_a_zero_character_is_told_without_it() {
    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    let capture = service.upload_good(&subject.name).await.name;
    let worker = service.worker(&["ingest"]).await;
    let lease = service.lease(&worker).await.expect("the ingest job waits");
    // Names of fields are what a file says.
    let error = JobError {
        violations: vec![Violation {
            field: "po\0se".into(),
            ..Violation::default()
        }],
        ..support::job_error("REJECTED", "a\0b")
    };
    let ended = service.end(&lease, Outcome::Failed(error)).await;
    ended.expect("is recorded");
    let rejected = service.get_capture(&capture).await;
    assert_eq!(rejected.violations[0].field, "pose");
}

#[tokio::test]
async fn an_ingest_that_failed_for_want_of_the_store_is_tried_again_and_rejects_nothing() {
    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    let capture = service.upload_good(&subject.name).await.name;
    let worker = service.worker(&["ingest"]).await;
    let lease = service.lease(&worker).await.expect("the ingest job waits");
    let error = support::job_error("OBJECTS", "the store is out of reach");
    let ended = service.end(&lease, Outcome::Postponed(error)).await;
    ended.expect("is recorded");
    let job = service.get_job(&support::job_name(&lease)).await;
    assert_eq!((job.state(), job.error), (job::State::Queued, None));
    let waiting = service.get_capture(&capture).await;
    assert_eq!(waiting.state(), capture::State::Ingesting);
    assert_eq!(service.lease(&worker).await, None, "not at once");
    let again = eventually("the next try", || service.lease(&worker)).await;
    assert!(again.token > lease.token);
    service.complete_ingest(&again).await;
    let done = service.get_capture(&capture).await;
    assert_eq!(done.state(), capture::State::Ready);
}

/// Asks for another ingest of the capture `name`.
async fn ingest_again(service: &Service, name: &str) -> Result<Capture, Status> {
    let request = IngestCaptureRequest {
        name: name.into(),
        request_id: String::new(),
    };
    let again = service.subjects().ingest_capture(request).await;
    again.map(|answer| answer.into_inner())
}

/// Ends a leased ingest job with `violations`, or with another error if there are none.
async fn fail(service: &Service, lease: &Lease, violations: Vec<Violation>) {
    let error = JobError {
        code: "INTERNAL".into(),
        message: "it broke".into(),
        violations,
    };
    let failed = service.end(lease, Outcome::Failed(error)).await;
    failed.expect("is recorded");
}

#[tokio::test]
async fn an_ingest_that_brought_nothing_is_repeated_with_the_same_files() {
    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    let first = service.upload_good(&subject.name).await;
    let worker = service.worker(&["ingest"]).await;
    let state = async || service.get_capture(&first.name).await.state();

    // A fault of the machine rejects nothing.
    let lease = service.lease(&worker).await.expect("the ingest job waits");
    let early = ingest_again(&service, &first.name).await;
    assert_refused(early, Code::FailedPrecondition, "NOT_REPEATABLE");
    fail(&service, &lease, Vec::new()).await;
    assert_eq!(state().await, capture::State::Uploaded);
    let ada = service.get_subject(&subject.name).await;
    assert_eq!(ada.state(), subject::State::Uploaded);
    service.collect(false, true).await;
    let second = ingest_again(&service, &first.name)
        .await
        .expect("is queued");
    assert_ne!(second.ingest_job, first.ingest_job);

    // Nor does a cancel, before a worker has it or after.
    let cancel = async |name: &str| {
        let request = CancelJobRequest {
            name: name.into(),
            ..<_>::default()
        };
        service.jobs().cancel_job(request).await.expect("cancels");
    };
    cancel(&second.ingest_job).await;
    assert_eq!(state().await, capture::State::Uploaded);
    let third = ingest_again(&service, &first.name)
        .await
        .expect("is queued");
    let lease = service.lease(&worker).await.expect("the ingest job waits");
    cancel(&third.ingest_job).await;
    let stopped = Outcome::Cancelled(Cancelled {});
    service.end(&lease, stopped).await.expect("ends");
    assert_eq!(state().await, capture::State::Uploaded);

    // A fault of the files does, and is forgotten when they are read again.
    ingest_again(&service, &first.name)
        .await
        .expect("is queued");
    let lease = service.lease(&worker).await.expect("the ingest job waits");
    fail(&service, &lease, vec![Violation::default()]).await;
    assert_eq!(state().await, capture::State::Rejected);
    let again = ingest_again(&service, &first.name)
        .await
        .expect("is queued");
    assert_eq!(again.violations, []);
    let lease = service.lease(&worker).await.expect("the ingest job waits");
    let files = lease.inputs.clone().expect("has inputs").files;
    assert_eq!(files.len(), 2);
    service.complete_ingest(&lease).await;
    assert_eq!(state().await, capture::State::Ready);
    let ready = ingest_again(&service, &first.name).await;
    assert_refused(ready, Code::FailedPrecondition, "NOT_REPEATABLE");
}

#[tokio::test]
async fn an_ingest_without_its_files_is_not_repeated() {
    let service = Service::start_with(|config| config.storage.grace = Duration::ZERO).await;
    let subject = service.subject("Ada").await;
    let capture = service.upload_good(&subject.name).await;
    let worker = service.worker(&["ingest"]).await;
    let lease = service.lease(&worker).await.expect("the ingest job waits");
    fail(&service, &lease, vec![Violation::default()]).await;
    // Its owner was told what is wrong with them.
    service.collect(false, false).await;
    let again = ingest_again(&service, &capture.name).await;
    assert_refused(again, Code::FailedPrecondition, "UPLOAD_GONE");
    let state = service.get_capture(&capture.name).await.state();
    assert_eq!(state, capture::State::Rejected);
}
