//! Export jobs: requirements, inputs, committed files, valid results, and what goes with them.

use crate::support::{Service, assert_invalid, assert_refused, claim, id};
use std::time::Duration;
use tonic::{Code, Status};
use yoto_proto::keys;
use yoto_proto::names::object;
use yoto_proto::v1::{
    CaptureMotion, Checkpoint, ConsentPurpose, DeleteCaptureRequest, DeleteCheckpointRequest,
    DeleteModelRequest, Distillation, DistilledSplats, ExportForm, ExportMotion, ExportResult,
    ExportSpec, ExportedFile, GrantConsentRequest, Job, JobKind, ListJobsRequest,
    ListObjectsRequest, Model, NamedObject, PauseJobsRequest, RenderedFile, ResumeJobsRequest,
    RevokeConsentRequest, Subject, export_motion, job, job_result, job_spec,
};
use yoto_proto::worker::v1::{CommitOutputRequest, Lease};

fn spec(model: &Model, subject: &Subject, form: ExportForm) -> ExportSpec {
    ExportSpec {
        model: model.name.clone(),
        subject: subject.name.clone(),
        form: form.into(),
        ..ExportSpec::default()
    }
}

fn moved_by(driver: &Subject) -> ExportMotion {
    ExportMotion {
        motion: Some(export_motion::Motion::Capture(CaptureMotion {
            driver: driver.name.clone(),
            ..CaptureMotion::default()
        })),
        ..ExportMotion::default()
    }
}

async fn create(service: &Service, spec: &ExportSpec) -> Result<Job, Status> {
    service
        .create_job(job_spec::Kind::Export(spec.clone()))
        .await
}

/// A model of one subject with a checkpoint.
struct Trained {
    /// Runs all that these tests need.
    worker: String,
    model: Model,
    /// Its training, which is still leased.
    training: Lease,
    checkpoint: Checkpoint,
}

async fn trained(service: &Service, subject: &Subject) -> Trained {
    let worker = service.worker(&["train", "export"]).await;
    let model = service.model_of(subject).await;
    let (training, checkpoint) = service.train_to(&model, &worker, 40).await;
    Trained {
        worker,
        model,
        training,
        checkpoint,
    }
}

/// An exported file, stored as an object of this lease.
async fn written(service: &Service, lease: &Lease, file: &str) -> ExportedFile {
    let job = lease.job.clone().expect("has a job");
    let key = keys::render(id(&job.name), lease.token, file);
    ExportedFile {
        file: file.into(),
        object: Some(service.put(&key, file.as_bytes()).await),
        content_type: "model/obj".into(),
    }
}

async fn commit(service: &Service, lease: &Lease, file: &ExportedFile) -> Result<(), Status> {
    let request = CommitOutputRequest {
        claim: Some(claim(lease)),
        file: Some(RenderedFile {
            file: file.file.clone(),
            object: file.object.clone(),
        }),
    };
    service.workers().commit_output(request).await.map(drop)
}

async fn listed(service: &Service, job: &str) -> Result<Vec<NamedObject>, Status> {
    let request = ListObjectsRequest {
        parent: job.into(),
        ..ListObjectsRequest::default()
    };
    let answer = service.objects().list_objects(request).await;
    answer.map(|answer| answer.into_inner().objects)
}

#[tokio::test]
async fn an_export_needs_a_checkpoint_and_known_people() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let bob = service.ready_subject("Bob").await;
    let cleo = service.subject("Cleo").await;
    let model = service.model_of(&ada).await;
    let good = spec(&model, &ada, ExportForm::Page);
    let early = create(&service, &good).await;
    assert_refused(early, Code::FailedPrecondition, "NO_CHECKPOINT");
    let stranger = create(&service, &spec(&model, &bob, ExportForm::Page)).await;
    assert_refused(stranger, Code::FailedPrecondition, "NO_SLOT");
    let mut unknown = good.clone();
    unknown.subject = "subjects/none".into();
    let unknown = create(&service, &unknown).await;
    assert_refused(unknown, Code::NotFound, "NOT_FOUND");
    let mut unfilmed = good.clone();
    unfilmed.motions = vec![moved_by(&bob), moved_by(&cleo)];
    let unfilmed = create(&service, &unfilmed).await;
    assert_refused(unfilmed, Code::FailedPrecondition, "SUBJECT_NOT_READY");

    let formless = create(&service, &spec(&model, &ada, ExportForm::Unspecified)).await;
    assert_invalid(formless, "spec.export.form");
    let mut framed = good.clone();
    framed.frame = Some(3);
    assert_invalid(create(&service, &framed).await, "spec.export.frame");
    let mut still = spec(&model, &ada, ExportForm::SplatsSpz);
    still.motions = vec![moved_by(&bob)];
    assert_invalid(create(&service, &still).await, "spec.export.frame");
}

#[tokio::test]
async fn a_worker_gets_what_the_person_agrees_to_for_the_files() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let Trained { worker, model, .. } = trained(&service, &ada).await;
    let rights = async || {
        let order = spec(&model, &ada, ExportForm::Page);
        create(&service, &order).await.expect("is queued");
        let lease = service.lease(&worker).await.expect("the export waits");
        lease.inputs.expect("has inputs").rights
    };
    assert_eq!(rights().await, "", "nobody was asked");
    let agreed = GrantConsentRequest {
        subject: ada.name.clone(),
        purposes: vec![ConsentPurpose::ConsentExport.into()],
        given_by: "Ada's father".into(),
        ..GrantConsentRequest::default()
    };
    let granted = service.subjects().grant_consent(agreed).await;
    granted.expect("is recorded");
    let refused = RevokeConsentRequest {
        subject: ada.name.clone(),
        purposes: vec![ConsentPurpose::ConsentShare.into()],
        ..RevokeConsentRequest::default()
    };
    let revoked = service.subjects().revoke_consent(refused).await;
    revoked.expect("is recorded");
    let said = rights().await;
    let end = "the person shown agrees to: export; does not agree to: share";
    assert!(said.starts_with("As of 2") && said.ends_with(end), "{said}");
}

#[tokio::test]
async fn splats_are_made_of_fields_alone() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let worker = service.worker(&["train"]).await;
    let wanted = Some(Distillation {
        seconds: 5.0,
        size: 64,
        ..Distillation::default()
    });
    for (tier, refused) in [("splat", true), ("draft", false)] {
        let model = service.model_of_tier(tier, tier).await;
        let model = service.joined(model, &ada).await;
        service.train_to(&model, &worker, 1).await;
        let mut order = spec(&model, &ada, ExportForm::SplatsSpz);
        order.distillation = wanted;
        let answer = create(&service, &order).await;
        match refused {
            true => assert_invalid(answer, "spec.export.distillation"),
            false => drop(answer.expect("is queued")),
        }
    }
}

#[tokio::test]
async fn a_worker_gets_everybody_s_captures_and_its_files_are_kept_until_the_job_is_deleted() {
    let service = Service::start_with(|config| config.storage.grace = Duration::ZERO).await;
    let ada = service.ready_subject("Ada").await;
    let bob = service.ready_subject("Bob").await;
    let Trained {
        worker,
        model,
        training,
        checkpoint,
    } = trained(&service, &ada).await;
    let mut order = spec(&model, &ada, ExportForm::MeshObj);
    (order.motions, order.frame) = (vec![moved_by(&bob)], Some(0));
    let job = create(&service, &order).await.expect("is queued");
    assert_eq!((job.kind(), &job.model), (JobKind::Export, &model.name));
    let lease = service.lease(&worker).await.expect("the export waits");
    let inputs = lease.inputs.clone().expect("has inputs");
    let people: Vec<&str> = inputs.shards.iter().map(|it| &*it.subject).collect();
    assert_eq!(people, [&*ada.name, &*bob.name]);
    assert_eq!(inputs.checkpoints.len(), 1);

    // What it uses stays meanwhile.
    let request = DeleteCheckpointRequest {
        name: checkpoint.name.clone(),
        ..<_>::default()
    };
    let answer = service.models().delete_checkpoint(request).await;
    assert_refused(answer, Code::FailedPrecondition, "CHECKPOINT_BUSY");
    let request = DeleteCaptureRequest {
        name: bob.captures[0].clone(),
        ..<_>::default()
    };
    let answer = service.subjects().delete_capture(request).await;
    assert_refused(answer, Code::FailedPrecondition, "SUBJECT_BUSY");

    let mut files = Vec::new();
    for file in ["ada.obj", "ada.mtl", "ada.png"] {
        files.push(written(&service, &lease, file).await);
    }
    commit(&service, &lease, &files[0]).await.expect("commits");
    let early = listed(&service, &job.name).await.expect("lists");
    assert_eq!(early.len(), 1, "users see each as soon as it is there");
    assert_eq!(service.get_job(&job.name).await.outputs, 1);
    let mut result = ExportResult {
        files,
        checkpoint: checkpoint.name.clone(),
        triangles: 500,
        texture: 64,
        ..ExportResult::default()
    };
    let kind = job_result::Kind::Export(result.clone());
    service.complete(&lease, kind).await.expect("completes");
    let done = service.get_job(&job.name).await;
    assert_eq!(done.state(), job::State::Succeeded);
    let kept = done.result.and_then(|it| it.kind);
    for object in result.files.iter_mut().flat_map(|it| &mut it.object) {
        object.key.clear();
    }
    assert_eq!(kept, Some(job_result::Kind::Export(result)));
    let files = listed(&service, &job.name).await.expect("lists");
    let names: Vec<&str> = files.iter().map(|it| &*it.file).collect();
    assert_eq!(names, ["ada.obj", "ada.mtl", "ada.png"]);
    assert_eq!(files[0].name, object(&job.name, "ada.obj"));
    let folder = format!("renders/{}", id(&job.name));
    assert!(service.has(&folder));

    service.complete_training(&training, &checkpoint).await;
    let request = DeleteModelRequest {
        name: model.name,
        ..<_>::default()
    };
    let deleted = service.models().delete_model(request).await;
    assert_eq!(deleted.expect("deletes").into_inner().jobs, 2);
    service.collect(false, true).await;
    assert!(!service.has(&folder), "it went with its model");
}

#[tokio::test]
async fn results_that_can_not_be_are_refused_and_good_ones_are_no_garbage() {
    let service = Service::start_with(|config| config.storage.grace = Duration::ZERO).await;
    let ada = service.ready_subject("Ada").await;
    let Trained {
        worker,
        model,
        checkpoint,
        ..
    } = trained(&service, &ada).await;
    let order = spec(&model, &ada, ExportForm::SplatsSpz);
    create(&service, &order).await.expect("is queued");
    let lease = service.lease(&worker).await.expect("the export waits");
    let good = ExportResult {
        files: vec![written(&service, &lease, "person.spz").await],
        checkpoint: checkpoint.name,
        splats: 9,
        distilled: Some(DistilledSplats {
            psnr: Some(30.0),
            ..DistilledSplats::default()
        }),
        ..ExportResult::default()
    };
    type Change = fn(&mut ExportResult);
    let cases: [(Change, &str); 5] = [
        (|it| it.checkpoint += "9", "result.export.checkpoint"),
        (|it| it.files.clear(), "result.export.files"),
        (
            |it| it.files[0].file = "person.ply".into(),
            "result.export.files",
        ),
        (
            |it| it.files[0].file = "other.spz".into(),
            "result.export.files[0].object.key",
        ),
        (
            |it| it.distilled.as_mut().expect("has some").psnr = Some(f64::NAN),
            "result.export.distilled",
        ),
    ];
    for (change, field) in cases {
        let mut bad = good.clone();
        change(&mut bad);
        let answer = service.complete(&lease, job_result::Kind::Export(bad));
        assert_invalid(answer.await, field);
    }
    let answer = service.complete(&lease, job_result::Kind::Export(good));
    answer.await.expect("is good");
    // It appears, although it was never committed separately.
    service.collect(false, true).await;
    let job = lease.job.expect("has a job").name;
    assert!(service.has(&keys::render(id(&job), lease.token, "person.spz")));
}

#[tokio::test]
async fn exports_are_paused_and_listed_by_their_kind() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let Trained { worker, model, .. } = trained(&service, &ada).await;
    let kind = JobKind::Export.into();
    let request = PauseJobsRequest {
        kind,
        reason: "the workers are busy".into(),
    };
    service.jobs().pause_jobs(request).await.expect("pauses");
    let order = spec(&model, &ada, ExportForm::Page);
    let job = create(&service, &order).await.expect("is queued");
    assert_eq!(service.lease(&worker).await, None);
    let request = ListJobsRequest {
        kinds: vec![kind],
        ..<_>::default()
    };
    let jobs = service.jobs().list_jobs(request).await.expect("lists");
    let jobs: Vec<String> = jobs
        .into_inner()
        .jobs
        .into_iter()
        .map(|it| it.name)
        .collect();
    assert_eq!(jobs, [job.name]);
    let request = ResumeJobsRequest { kind };
    service.jobs().resume_jobs(request).await.expect("resumes");
    service.lease(&worker).await.expect("the export waits");
}
