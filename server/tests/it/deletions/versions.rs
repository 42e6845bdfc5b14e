//! Deletions that are repeated, or that name a version.

use super::{assert_names, gone, service};
use crate::support::{Service, assert_refused};
use tonic::Code;
use yoto_proto::v1::{
    AddIdentityRequest, DeleteCaptureRequest, DeleteCheckpointRequest, DeleteJobRequest,
    DeleteModelRequest, DeleteSubjectRequest, RemoveIdentityRequest,
};

#[tokio::test]
async fn a_repeated_deletion_has_the_answer_of_the_first() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let request = |id: &str| DeleteSubjectRequest {
        name: ada.name.clone(),
        request_id: id.into(),
        etag: String::new(),
    };
    let delete = async |id: &str| service.subjects().delete_subject(request(id)).await;
    let first = delete("once").await.expect("deletes").into_inner();
    assert_eq!((first.captures, first.jobs), (1, 1));
    let again = delete("once").await.expect("is repeated").into_inner();
    assert_eq!(again, first);
    gone(delete("twice").await);
    let other = DeleteSubjectRequest {
        name: "subjects/other".into(),
        request_id: "once".into(),
        etag: String::new(),
    };
    let reused = service.subjects().delete_subject(other).await;
    assert_refused(reused, Code::AlreadyExists, "REQUEST_ID_REUSED");
}

#[tokio::test]
async fn a_repeated_change_of_identities_has_the_answer_of_the_first() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let model = service.model("shared").await;
    let add = async |id: &str| {
        let request = AddIdentityRequest {
            model: model.name.clone(),
            subject: ada.name.clone(),
            request_id: id.into(),
        };
        let added = service.models().add_identity(request).await;
        added.expect("has a slot").into_inner().slot
    };
    let remove = async |id: &str| {
        let request = RemoveIdentityRequest {
            model: model.name.clone(),
            subject: ada.name.clone(),
            request_id: id.into(),
        };
        service.models().remove_identity(request).await
    };
    assert_eq!(add("a").await, 0);
    let first = remove("b").await.expect("removes").into_inner();
    assert_eq!(first.slots, []);
    // Delivered late, the first call does not undo the second.
    assert_eq!(add("a").await, 0);
    let again = remove("b").await.expect("is repeated").into_inner();
    assert_eq!(again.slots, []);
    let other = remove("c").await;
    assert_refused(other, Code::NotFound, "NOT_FOUND");
    assert_eq!(add("d").await, 1);
}

#[tokio::test]
async fn a_deletion_that_names_a_version_is_limited_to_it() {
    let service = service().await;
    let before = service.subject("Ada").await;
    service.upload_good(&before.name).await;
    let worker = service.worker(&["ingest"]).await;
    let lease = service.lease(&worker).await.expect("the ingest job waits");
    service.complete_ingest(&lease).await;
    let ada = service.get_subject(&before.name).await;
    assert_ne!(before.etag, ada.etag, "she has a capture now");
    let delete = |name: &str, etag: &str| {
        let (mut subjects, request) = (
            service.subjects(),
            DeleteSubjectRequest {
                name: name.into(),
                etag: etag.into(),
                ..<_>::default()
            },
        );
        async move { subjects.delete_subject(request).await }
    };
    assert_names(
        delete(&ada.name, &before.etag).await,
        "ETAG_MISMATCH",
        "Ada has changed since it was read; nothing was changed",
    );
    assert_eq!(service.get_subject(&ada.name).await, ada);

    let capture = service.get_capture(&ada.captures[0]).await;
    let request = |etag: &str| DeleteCaptureRequest {
        name: capture.name.clone(),
        etag: etag.into(),
        ..<_>::default()
    };
    let other = service.subjects().delete_capture(request("other")).await;
    assert_names(other, "ETAG_MISMATCH", &capture.name);
    let its_own = service
        .subjects()
        .delete_capture(request(&capture.etag))
        .await;
    its_own.expect("is the version");

    let model = service.model("solo").await;
    let request = |etag: &str| DeleteModelRequest {
        name: model.name.clone(),
        etag: etag.into(),
        ..<_>::default()
    };
    let other = service.models().delete_model(request("other")).await;
    assert_names(other, "ETAG_MISMATCH", &model.name);
    let its_own = service.models().delete_model(request(&model.etag)).await;
    its_own.expect("is the version");

    let now = service.get_subject(&ada.name).await;
    delete(&ada.name, &now.etag).await.expect("is the version");
}

#[tokio::test]
async fn jobs_and_checkpoints_have_versions_too() {
    let service = service().await;
    let ada = service.ready_subject("Ada").await;
    let model = service.model_of(&ada).await;
    service.train(&model).await;
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    service.publish(&lease, 10).await.expect("publishes");
    let last = service.publish(&lease, 20).await.expect("publishes");
    service.complete_training(&lease, &last).await;
    let first = service.checkpoints(&model.name).await.remove(1);
    let request = |etag: &str| DeleteCheckpointRequest {
        name: first.name.clone(),
        etag: etag.into(),
        ..<_>::default()
    };
    let other = service.models().delete_checkpoint(request("other")).await;
    assert_names(other, "ETAG_MISMATCH", &first.name);
    let its_own = service
        .models()
        .delete_checkpoint(request(&first.etag))
        .await;
    its_own.expect("is the version");

    let name = &lease.job.as_ref().expect("a job").name;
    let job = service.get_job(name).await;
    let request = |etag: &str| DeleteJobRequest {
        name: name.clone(),
        etag: etag.into(),
        ..<_>::default()
    };
    let other = service.jobs().delete_job(request("other")).await;
    assert_names(other, "ETAG_MISMATCH", name);
    let its_own = service.jobs().delete_job(request(&job.etag)).await;
    its_own.expect("is the version");
}
