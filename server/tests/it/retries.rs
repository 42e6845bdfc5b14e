//! Orders of jobs that ended without success, queued again.

use crate::support::{Service, assert_refused, id, job_error};
use tonic::{Code, Status};
use yoto_proto::v1::{
    CancelJobRequest, CreateJobRequest, Job, JobPriority, JobSpec, RetryJobRequest, TrainSpec,
    capture, job, job_spec,
};
use yoto_proto::worker::v1::end_job_request::Outcome;

async fn retry(service: &Service, name: &str, request_id: &str) -> Result<Job, Status> {
    let request = RetryJobRequest {
        name: name.into(),
        request_id: request_id.into(),
    };
    let answer = service.jobs().retry_job(request).await;
    answer.map(|answer| answer.into_inner())
}

#[tokio::test]
async fn a_failed_job_is_queued_again_with_its_order_priority_and_owner() {
    let service = Service::start().await;
    let subject = service.ready_subject("Ada").await;
    let model = service.model_of(&subject).await;
    let spec = JobSpec {
        kind: Some(job_spec::Kind::Train(TrainSpec {
            model: model.name,
            steps: 7,
            ..<_>::default()
        })),
    };
    let request = CreateJobRequest {
        spec: Some(spec.clone()),
        priority: JobPriority::High.into(),
        owner: "lab".into(),
        ..<_>::default()
    };
    let created = service.jobs().create_job(request).await;
    let first = created.expect("is queued").into_inner();
    let refused = retry(&service, &first.name, "").await;
    assert_refused(refused, Code::FailedPrecondition, "NOT_REPEATABLE");
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    let error = Outcome::Failed(job_error("DIVERGED", "no"));
    service.end(&lease, error).await.expect("is recorded");

    let again = retry(&service, &first.name, "once").await;
    let again = again.expect("is queued again");
    assert_ne!(again.name, first.name);
    assert_eq!(again.state(), job::State::Queued);
    assert_eq!(again.spec, Some(spec));
    assert_eq!(again.priority(), JobPriority::High);
    assert_eq!(again.owner, "lab");
    let repeated = retry(&service, &first.name, "once").await;
    assert_eq!(repeated.expect("is the same call").name, again.name);
    let kept = service.get_job(&first.name).await;
    assert_eq!(kept.state(), job::State::Failed, "its history stays");

    let lease = service.lease(&worker).await.expect("the retry waits");
    let checkpoint = service.publish(&lease, 7).await.expect("publishes");
    service.complete_training(&lease, &checkpoint).await;
    let refused = retry(&service, &again.name, "").await;
    assert_refused(refused, Code::FailedPrecondition, "NOT_REPEATABLE");
    let refused = retry(&service, "jobs/none", "").await;
    assert_refused(refused, Code::NotFound, "NOT_FOUND");
}

#[tokio::test]
async fn a_retry_is_checked_as_a_new_order_is() {
    let service = Service::start().await;
    let subject = service.ready_subject("Ada").await;
    let model = service.model_of(&subject).await;
    let worker = service.worker(&["train"]).await;
    service.train(&model).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    let checkpoint = service.publish(&lease, 3).await.expect("publishes");
    service.complete_training(&lease, &checkpoint).await;
    let render = service.render(&model, &subject, &checkpoint.name).await;
    let cancel = CancelJobRequest {
        name: render.name.clone(),
        request_id: String::new(),
    };
    service.jobs().cancel_job(cancel).await.expect("ends");
    service.database.run("DELETE FROM checkpoints").await;
    let refused = retry(&service, &render.name, "").await;
    assert_refused(refused, Code::NotFound, "NOT_FOUND");
}

#[tokio::test]
async fn a_failed_ingest_job_reads_the_files_of_its_capture_again() {
    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    let capture = service.upload_good(&subject.name).await;
    let worker = service.worker(&["ingest"]).await;
    let lease = service.lease(&worker).await.expect("the ingest job waits");
    let error = Outcome::Failed(job_error("INTERNAL", "the machine"));
    service.end(&lease, error).await.expect("is recorded");
    let again = retry(&service, &capture.ingest_job, "once").await;
    let again = again.expect("is queued again");
    assert_ne!(id(&again.name), id(&capture.ingest_job));
    let now = service.get_capture(&capture.name).await;
    assert_eq!(now.state(), capture::State::Ingesting);
    assert_eq!(now.ingest_job, again.name);
    let repeated = retry(&service, &capture.ingest_job, "once").await;
    assert_eq!(repeated.expect("is the same call").name, again.name);
    let lease = service.lease(&worker).await.expect("the retry waits");
    service.complete_ingest(&lease).await;
    let refused = retry(&service, &capture.ingest_job, "").await;
    assert_refused(refused, Code::FailedPrecondition, "NOT_REPEATABLE");
}
