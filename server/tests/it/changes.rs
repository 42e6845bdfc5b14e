//! Changes of resources under a mask, and orders that are only checked.

use crate::support::{Service, assert_invalid, assert_refused};
use prost_types::FieldMask;
use tonic::{Code, Status};
use yoto_proto::v1::{
    CreateJobRequest, JobKind, JobPriority, JobSpec, ListJobsRequest, Subject, TrainSpec,
    UpdateSubjectRequest, job, job_spec,
};

async fn update(service: &Service, subject: Subject, paths: &[&str]) -> Result<Subject, Status> {
    let request = UpdateSubjectRequest {
        subject: Some(subject),
        update_mask: Some(FieldMask {
            paths: paths.iter().map(|&path| path.to_owned()).collect(),
        }),
    };
    let answer = service.subjects().update_subject(request).await;
    answer.map(|answer| answer.into_inner())
}

#[tokio::test]
async fn only_the_named_fields_of_a_person_change() {
    let service = Service::start().await;
    let before = service.subject("Ada").await;
    let wanted = |etag: &str| Subject {
        name: before.name.clone(),
        display_name: "Ada L.".into(),
        consent_note: "signed".into(),
        etag: etag.into(),
        ..Subject::default()
    };
    let named = update(&service, wanted(""), &["display_name"]).await;
    let named = named.expect("is changed");
    assert_eq!((&*named.display_name, &*named.consent_note), ("Ada L.", ""));
    let stale = update(&service, wanted(&before.etag), &["consent_note"]).await;
    assert_refused(stale, Code::Aborted, "ETAG_MISMATCH");
    let noted = update(&service, wanted(&named.etag), &["consent_note"]).await;
    let noted = noted.expect("is changed");
    assert_eq!(noted, service.get_subject(&before.name).await);
    assert_eq!(noted.consent_note, "signed");

    assert_invalid(update(&service, wanted(""), &[]).await, "update_mask");
    let state = update(&service, wanted(""), &["state"]).await;
    assert_invalid(state, "update_mask");
    let bad = Subject {
        display_name: "a,b".into(),
        ..wanted("")
    };
    let bad = update(&service, bad, &["display_name"]).await;
    assert_invalid(bad, "display_name");
    let none = Subject {
        name: "subjects/none".into(),
        ..wanted("")
    };
    let none = update(&service, none, &["display_name"]).await;
    assert_refused(none, Code::NotFound, "NOT_FOUND");
}

#[tokio::test]
async fn an_order_can_be_checked_without_being_queued() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let model = service.model_of(&ada).await;
    let request = |model: &str| CreateJobRequest {
        spec: Some(JobSpec {
            kind: Some(job_spec::Kind::Train(TrainSpec {
                model: model.into(),
                steps: 5,
                ..<_>::default()
            })),
        }),
        priority: JobPriority::High.into(),
        request_id: "once".into(),
        validate_only: true,
        ..<_>::default()
    };
    let checked = service.jobs().create_job(request(&model.name)).await;
    let checked = checked.expect("is good").into_inner();
    assert_eq!((&*checked.name, checked.state()), ("", job::State::Queued));
    assert_eq!(checked.kind(), JobKind::Train);
    assert_eq!(checked.priority(), JobPriority::High);
    let bad = service.jobs().create_job(request("models/none")).await;
    assert_refused(bad, Code::NotFound, "NOT_FOUND");
    let request = ListJobsRequest {
        kinds: vec![JobKind::Train.into()],
        ..<_>::default()
    };
    let listed = service.jobs().list_jobs(request).await.expect("lists");
    assert_eq!(listed.into_inner().jobs, []);
}
