//! Deletions: refused while something is in use, complete otherwise, and done once.

mod versions;

use crate::support;
use crate::support::{Service, assert_refused, eventually, id};
use std::time::Duration;
use tonic::{Code, Response, Status};
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::{
    AddIdentityRequest, CancelJobRequest, DeleteCaptureRequest, DeleteCheckpointRequest,
    DeleteJobRequest, DeleteModelRequest, DeleteSubjectRequest, Deleted, GetCaptureRequest,
    ListJobsRequest, MotionTransfer, RenderSpec, job_spec,
};

type Answer = Result<Response<Deleted>, Status>;

async fn delete_model(service: &Service, name: &str) -> Answer {
    let request = DeleteModelRequest {
        name: name.into(),
        ..<_>::default()
    };
    service.models().delete_model(request).await
}

async fn delete_checkpoint(service: &Service, name: &str) -> Answer {
    let request = DeleteCheckpointRequest {
        name: name.into(),
        ..<_>::default()
    };
    service.models().delete_checkpoint(request).await
}

async fn delete_job(service: &Service, name: &str) -> Answer {
    let request = DeleteJobRequest {
        name: name.into(),
        ..<_>::default()
    };
    service.jobs().delete_job(request).await
}

async fn delete_subject(service: &Service, name: &str) -> Answer {
    let request = DeleteSubjectRequest {
        name: name.into(),
        ..<_>::default()
    };
    service.subjects().delete_subject(request).await
}

async fn delete_capture(service: &Service, name: &str) -> Answer {
    let request = DeleteCaptureRequest {
        name: name.into(),
        ..<_>::default()
    };
    service.subjects().delete_capture(request).await
}

async fn cancel(service: &Service, name: &str) {
    let request = CancelJobRequest {
        name: name.into(),
        request_id: String::new(),
    };
    service.jobs().cancel_job(request).await.expect("cancels");
}

/// The refusal has `reason` and names `what`.
fn assert_names(answer: Answer, reason: &str, what: &str) {
    let message = answer
        .as_ref()
        .expect_err("is refused")
        .message()
        .to_owned();
    assert!(message.contains(what), "{message}");
    let code = match reason {
        "ETAG_MISMATCH" => Code::Aborted,
        _ => Code::FailedPrecondition,
    };
    assert_refused(answer, code, reason);
}

fn gone(answer: Answer) {
    assert_refused(answer, Code::NotFound, "NOT_FOUND");
}

/// Garbage goes at once.
async fn service() -> Service {
    Service::start_with(|config| config.storage.grace = Duration::ZERO).await
}

#[tokio::test]
async fn a_model_is_deleted_with_its_jobs_and_all_their_bytes() {
    let service = service().await;
    let ada = service.ready_subject("Ada").await;
    let model = service.model_of(&ada).await;
    let training = service.train(&model).await;
    assert_names(
        delete_model(&service, &model.name).await,
        "MODEL_BUSY",
        &training.name,
    );
    let worker = service.worker(&["train", "render"]).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    assert_names(
        delete_model(&service, &model.name).await,
        "MODEL_BUSY",
        &training.name,
    );
    let checkpoint = service.publish(&lease, 1).await.expect("publishes");
    service.render(&model, &ada, "").await;
    service.complete_training(&lease, &checkpoint).await;
    let lease = service.lease(&worker).await.expect("the render waits");
    service.complete_render(&lease).await;

    let deleted = delete_model(&service, &model.name).await.expect("deletes");
    let deleted = deleted.into_inner();
    assert_eq!(
        (deleted.checkpoints, deleted.jobs, deleted.captures),
        (1, 2, 0)
    );
    gone(delete_model(&service, &model.name).await);
    let jobs = service.jobs().list_jobs(ListJobsRequest::default()).await;
    assert_eq!(
        jobs.expect("lists").into_inner().jobs.len(),
        1,
        "the ingest job"
    );
    service.collect(false, false).await;
    assert!(!service.has("models") && !service.has("renders"));

    let deleted = delete_subject(&service, &ada.name)
        .await
        .expect("is in no model");
    let deleted = deleted.into_inner();
    assert_eq!((deleted.captures, deleted.jobs), (1, 1));
    gone(delete_subject(&service, &ada.name).await);
    let name = ada.captures[0].clone();
    let answer = service
        .subjects()
        .get_capture(GetCaptureRequest { name })
        .await;
    assert_refused(answer, Code::NotFound, "NOT_FOUND");
    service.collect(false, false).await;
    assert_eq!(service.stored_files(), [] as [std::path::PathBuf; 0]);
}

#[tokio::test]
async fn a_checkpoint_in_use_is_not_deleted() {
    let service = service().await;
    let ada = service.ready_subject("Ada").await;
    let model = service.model_of(&ada).await;
    let training = service.train(&model).await;
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    let mut all = Vec::new();
    for (step, psnr) in [(1, 20.0), (2, 30.0), (3, 25.0)] {
        let published = service.publish_with(&lease, step, psnr).await;
        all.push(published.expect("publishes"));
    }
    let render = service.render(&model, &ada, "").await;
    let best = delete_checkpoint(&service, &all[1].name).await;
    assert_names(best, "CHECKPOINT_BUSY", &render.name);
    let newest = delete_checkpoint(&service, &all[2].name).await;
    assert_names(newest, "CHECKPOINT_BUSY", &training.name);
    delete_checkpoint(&service, &all[0].name)
        .await
        .expect("is not used");
    gone(delete_checkpoint(&service, &all[0].name).await);
    cancel(&service, &render.name).await;
    delete_checkpoint(&service, &all[1].name)
        .await
        .expect("is not used now");
    service.complete_training(&lease, &all[2]).await;
    delete_checkpoint(&service, &all[2].name)
        .await
        .expect("is not used now");
    assert!(service.checkpoints(&model.name).await.is_empty());
    gone(delete_checkpoint(&service, "models/other/checkpoints/1").await);
}

#[tokio::test]
async fn a_job_is_deleted_once_it_has_ended() {
    let service = service().await;
    let ada = service.ready_subject("Ada").await;
    let model = service.model_of(&ada).await;
    let training = service.train(&model).await;
    assert_names(
        delete_job(&service, &training.name).await,
        "JOB_OPEN",
        "QUEUED",
    );
    let worker = service.worker(&["train"]).await;
    // On PostgreSQL the refused deletion may hold the row for a moment, and a worker passes over rows that others hold.
    let lease = eventually("the training", || service.lease(&worker)).await;
    let checkpoint = service.publish(&lease, 1).await.expect("publishes");
    assert_names(
        delete_job(&service, &training.name).await,
        "JOB_OPEN",
        "RUNNING",
    );
    service.complete_training(&lease, &checkpoint).await;
    delete_job(&service, &training.name).await.expect("deletes");
    gone(delete_job(&service, &training.name).await);
    let kept = service.checkpoints(&model.name).await;
    assert_eq!(kept.len(), 1, "a model outlives its trainings");
    service.collect(false, false).await;
    assert!(service.has(&checkpoint.manifest.expect("has one").key));
}

#[tokio::test]
async fn a_person_in_a_model_or_a_job_is_not_deleted() {
    let service = service().await;
    let (ada, bob) = (
        service.ready_subject("Ada").await,
        service.ready_subject("Bob").await,
    );
    let model = service.model_of(&ada).await;
    assert_names(
        delete_subject(&service, &ada.name).await,
        "SUBJECT_IN_MODEL",
        "shared",
    );
    let worker = service.worker(&["train"]).await;
    service.train_to(&model, &worker, 1).await;
    // Bob has no slot, but Ada moves as he did.
    let spec = RenderSpec {
        model: model.name.clone(),
        subject: ada.name.clone(),
        what: Some(What::Motion(MotionTransfer {
            driver: bob.name.clone(),
            frame_step: 1,
            size: 8,
            ..<_>::default()
        })),
        ..<_>::default()
    };
    let render = service.create_job(job_spec::Kind::Render(spec)).await;
    let render = render.expect("is queued").name;
    assert_names(
        delete_subject(&service, &bob.name).await,
        "SUBJECT_BUSY",
        &render,
    );
    let capture = &bob.captures[0];
    assert_names(
        delete_capture(&service, capture).await,
        "SUBJECT_BUSY",
        &render,
    );
    cancel(&service, &render).await;
    delete_subject(&service, &bob.name)
        .await
        .expect("nobody uses him now");
    let request = AddIdentityRequest {
        model: model.name.clone(),
        subject: bob.name.clone(),
        ..<_>::default()
    };
    let added = service.models().add_identity(request).await;
    assert_refused(added, Code::NotFound, "NOT_FOUND");
}

#[tokio::test]
async fn a_capture_is_deleted_when_another_has_taken_its_place() {
    let service = service().await;
    let ada = service.ready_subject("Ada").await;
    let first = ada.captures[0].clone();
    let model = service.model_of(&ada).await;
    assert_names(
        delete_capture(&service, &first).await,
        "CAPTURE_IN_MODEL",
        "shared",
    );
    let uploaded = service.upload_good(&ada.name).await;
    let second = uploaded.name.clone();
    let busy = delete_capture(&service, &second).await;
    assert_names(busy, "CAPTURE_BUSY", &uploaded.ingest_job);
    assert_names(
        delete_capture(&service, &first).await,
        "CAPTURE_IN_MODEL",
        "shared",
    );
    let worker = service.worker(&["ingest"]).await;
    let lease = service.lease(&worker).await.expect("the ingest job waits");
    service.complete_ingest(&lease).await;
    let training = service.train(&model).await;
    assert_names(
        delete_capture(&service, &first).await,
        "SUBJECT_BUSY",
        &training.name,
    );
    cancel(&service, &training.name).await;
    delete_capture(&service, &first).await.expect("deletes");
    gone(delete_capture(&service, &first).await);
    service.collect(false, false).await;
    assert!(!service.has(&format!("captures/{}", id(&first))));
    assert!(service.has(&format!("captures/{}", id(&second))));
    assert_eq!(service.get_subject(&ada.name).await.captures, [second]);
}

#[tokio::test]
async fn an_open_upload_is_deleted_with_its_bytes() {
    let service = Service::start_with(|config| config.storage.grace = Duration::ZERO).await;
    let ada = service.subject("Ada").await;
    let files = [support::file("poses.json", b"{}")];
    let upload = service.open_upload(&ada.name, &files).await;
    let upload = upload.expect("is opened");
    let written = support::chunks(&upload.name, &files);
    service.write(written.clone()).await.expect("writes");
    delete_subject(&service, &ada.name).await.expect("deletes");
    let late = service.write(written).await;
    assert_refused(late, Code::NotFound, "NOT_FOUND");
    service.collect(false, false).await;
    assert!(!service.has("uploads"));
}
