//! All faults of a request come in one answer.

use crate::support::{Service, file, headers};
use tonic::{Code, Status};
use tonic_types::StatusExt;
use yoto_proto::limits::VIOLATIONS;
use yoto_proto::v1::{
    CreateJobRequest, CreateModelRequest, CreateUploadRequest, JobSpec, ListJobsRequest,
    PauseJobsRequest, TrainSpec, job_spec,
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

#[tokio::test]
async fn an_upload_names_its_bad_files_as_far_as_there_is_room() {
    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    let good = [file("poses.json", b"{}"), file("frames/000000.png", b"a")];
    let mut request = CreateUploadRequest {
        subject: subject.name,
        files: headers(&good),
        request_id: String::new(),
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
