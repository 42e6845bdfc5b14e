//! All faults of a request come in one answer.

use crate::support::{Service, assert_refused, file, headers};
use tonic::{Code, Status};
use tonic_types::StatusExt;
use yoto_proto::limits::VIOLATIONS;
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::{
    CreateJobRequest, CreateModelRequest, CreateRenderRequest, CreateSubjectRequest,
    CreateUploadRequest, EvaluateSpec, JobSpec, ListJobsRequest, ListModelsRequest, Orbit,
    PauseJobsRequest, RenderSpec, TrainSpec, job_spec,
};
use yoto_proto::worker::v1::RegisterWorkerRequest;

/// The paths of all named fields.
fn fields<T: std::fmt::Debug>(answer: Result<T, Status>) -> Vec<String> {
    let status = answer.expect_err("is refused");
    assert_eq!(status.code(), Code::InvalidArgument, "{status}");
    let details = status.get_error_details();
    let bad = details.bad_request().expect("has a BadRequest");
    let fields = bad.field_violations.iter();
    fields.map(|found| found.field.clone()).collect()
}

#[tokio::test]
async fn an_order_gets_all_faults_of_its_fields() {
    let service = Service::start().await;
    let train = TrainSpec {
        seconds: -1.0,
        image_size: 7,
        ..<_>::default()
    };
    let request = CreateJobRequest {
        spec: Some(JobSpec {
            kind: Some(job_spec::Kind::Train(train)),
        }),
        request_id: "a\nb".into(),
        priority: 99,
        owner: "x".repeat(100),
        validate_only: true,
    };
    let found = fields(service.jobs().create_job(request).await);
    let expected = [
        "request_id",
        "priority",
        "owner",
        "spec.train.seconds",
        "spec.train.image_size",
    ];
    assert_eq!(found, expected);
}

#[tokio::test]
async fn other_calls_name_all_fields_too() {
    let service = Service::start().await;
    let model = CreateModelRequest {
        display_name: "a,b".into(),
        tier: "none".into(),
        variant: "none".into(),
        ..<_>::default()
    };
    let found = fields(service.models().create_model(model).await);
    assert_eq!(found, ["display_name", "tier", "variant"]);
    let list = ListJobsRequest {
        page_size: -1,
        states: vec![88, 99],
        kinds: vec![77],
        model: "jobs/1".into(),
        view: 5,
        ..<_>::default()
    };
    let found = fields(service.jobs().list_jobs(list).await);
    let expected = ["page_size", "states", "states", "kinds", "model", "view"];
    assert_eq!(found, expected);
    let pause = PauseJobsRequest {
        kind: 99,
        reason: "a\nb".into(),
    };
    let found = fields(service.jobs().pause_jobs(pause).await);
    assert_eq!(found, ["kind", "reason"]);
    let worker = RegisterWorkerRequest::default();
    let found = fields(service.workers().register_worker(worker).await);
    assert_eq!(found, ["display_name", "device", "kinds"]);
}

/// The reasons of all faults but those of fields.
fn reasons<T: std::fmt::Debug>(answer: Result<T, Status>) -> Vec<String> {
    let status = answer.expect_err("is refused");
    let details = status.get_error_details();
    let failed = details.precondition_failure();
    let failed = failed.expect("has a PreconditionFailure");
    let violations = failed.violations.iter();
    violations.map(|found| found.r#type.clone()).collect()
}

#[tokio::test]
async fn what_only_the_catalogue_shows_comes_at_once() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let raw = service.subject("Bob").await;
    let model = service.model_of(&ada).await;
    let order = |kind| CreateJobRequest {
        spec: Some(JobSpec { kind: Some(kind) }),
        ..<_>::default()
    };
    // A person without a slot, one without a capture, nobody, and no checkpoint.
    let other = service.ready_subject("Eve").await;
    let evaluate = EvaluateSpec {
        model: model.name.clone(),
        subjects: vec![other.name, raw.name, "subjects/nobody".into()],
        ..<_>::default()
    };
    let evaluate = order(job_spec::Kind::Evaluate(evaluate));
    let refused = service.jobs().create_job(evaluate.clone()).await;
    let status = refused.as_ref().expect_err("is refused");
    assert_eq!(status.code(), Code::FailedPrecondition);
    assert!(status.message().contains("5 faults in all"), "{status}");
    let expected = [
        "NO_SLOT",
        "SUBJECT_NOT_READY",
        "NO_SLOT",
        "NOT_FOUND",
        "NO_CHECKPOINT",
    ];
    assert_eq!(reasons(refused), expected);
    let checked = CreateJobRequest {
        validate_only: true,
        ..evaluate
    };
    assert_eq!(reasons(service.jobs().create_job(checked).await), expected);
}

#[tokio::test]
async fn every_create_call_can_be_checked_alone() {
    let service = Service::start().await;
    let subject = CreateSubjectRequest {
        display_name: "Ada".into(),
        request_id: "same".into(),
        validate_only: true,
        ..<_>::default()
    };
    let checked = service.subjects().create_subject(subject.clone()).await;
    let checked = checked.expect("is good").into_inner();
    assert_eq!((&*checked.name, &*checked.display_name), ("", "Ada"));
    let bad = CreateSubjectRequest {
        display_name: "a,b".into(),
        ..subject.clone()
    };
    let found = fields(service.subjects().create_subject(bad).await);
    assert_eq!(found, ["display_name"]);
    // Its request id is not used up.
    let created = CreateSubjectRequest {
        validate_only: false,
        ..subject
    };
    let created = service.subjects().create_subject(created).await;
    let ada = created.expect("is created").into_inner();
    let model = CreateModelRequest {
        display_name: "m".into(),
        tier: "draft".into(),
        variant: "yoto".into(),
        validate_only: true,
        ..<_>::default()
    };
    let checked = service.models().create_model(model).await;
    assert_eq!(checked.expect("is good").into_inner().name, "");
    let list = ListModelsRequest::default();
    let models = service.models().list_models(list).await;
    assert_eq!(models.expect("lists").into_inner().models, []);
    let mut upload = CreateUploadRequest {
        subject: ada.name.clone(),
        files: headers(&[file("poses.json", b"{}")]),
        validate_only: true,
        ..<_>::default()
    };
    let checked = service.uploads().create_upload(upload.clone()).await;
    let checked = checked.expect("is good").into_inner();
    assert_eq!((&*checked.name, checked.bytes), ("", 2));
    upload.files[0].sha256 = "x".into();
    let found = fields(service.uploads().create_upload(upload).await);
    assert_eq!(found, ["files[0].sha256"]);
    let ada = service.get_subject(&ada.name).await;
    assert_eq!(ada.captures, [] as [String; 0]);
    let ready = service.ready_subject("Bob").await;
    let render = CreateRenderRequest {
        spec: Some(RenderSpec {
            model: service.model_of(&ready).await.name,
            subject: ready.name,
            what: Some(What::Orbit(Orbit {
                frame: 0,
                views: 4,
                size: 32,
            })),
            ..<_>::default()
        }),
        validate_only: true,
        ..<_>::default()
    };
    let refused = service.renders().create_render(render).await;
    assert_refused(refused, Code::FailedPrecondition, "NO_CHECKPOINT");
}

#[tokio::test]
async fn an_upload_names_its_bad_files_as_far_as_there_is_room() {
    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    let good = [file("poses.json", b"{}"), file("frames/000000.png", b"a")];
    let mut request = CreateUploadRequest {
        subject: subject.name,
        files: headers(&good),
        request_id: String::new(),
        validate_only: false,
    };
    request.files[0].sha256 = "x".into();
    request.files[1].path = "../up.png".into();
    request.files[1].bytes = u64::MAX;
    let found = fields(service.uploads().create_upload(request.clone()).await);
    let expected = ["files[0].sha256", "files[1].path", "files[1].bytes"];
    assert_eq!(found, expected);
    let many = vec![request.files[0].clone(); 5000];
    request.files = many;
    let refused = service.uploads().create_upload(request).await;
    let message = refused
        .as_ref()
        .expect_err("is refused")
        .message()
        .to_owned();
    assert!(message.contains("faults in all, of which"), "{message}");
    let found = fields(refused);
    assert!((10..=VIOLATIONS).contains(&found.len()), "{found:?}");
}
