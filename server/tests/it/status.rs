//! The state of the service, jobs by state, and requests that the catalogue alone can refuse.

use crate::support::{Service, assert_invalid, assert_refused, claim, job_name};
use tonic::Code;
use yoto_proto::keys;
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::status_service_client::StatusServiceClient;
use yoto_proto::v1::{
    CreateRenderRequest, CreateSubjectRequest, GetStatusRequest, IngestResult, JobKind,
    ListJobsRequest, Orbit, Progress, RenderSpec, Subject, TrainSpec, job, job_result, job_spec,
};
use yoto_proto::worker::v1::HeartbeatRequest;

#[tokio::test]
async fn the_status_counts_jobs_and_knows_who_asks_for_them() {
    let service = Service::start().await;
    let mut status = StatusServiceClient::new(service.channel.clone());
    let mut get = async || {
        let answer = status.get_status(GetStatusRequest {}).await;
        answer.expect("answers").into_inner()
    };
    let empty = get().await;
    assert!(empty.workers.is_empty() && !empty.version.is_empty());
    assert_eq!((empty.queued, empty.running), (0, 0));
    assert!(empty.disk_free > Some(0) && empty.disk_free <= empty.disk_total);

    let subject = service.ready_subject("ada").await;
    let model = service.model_of(&subject).await;
    let first = service.train(&model).await;
    service.train(&model).await;
    let silent = service.worker(&["render"]).await;
    let worker = service.worker(&["train", "render"]).await;
    let lease = service.lease(&worker).await.expect("a job waits");
    let now = get().await;
    assert_eq!((now.queued, now.running), (1, 1));
    let known: Vec<&str> = now.workers.iter().map(|it| &*it.name).collect();
    assert!(!known.contains(&&*silent), "it never asked");
    let busy = now.workers.iter().find(|it| it.name == worker);
    let busy = busy.expect("has a job");
    assert_eq!(
        (&*busy.job, &*busy.display_name),
        (&*first.name, "test worker")
    );
    let kinds: Vec<JobKind> = busy.kinds().collect();
    assert_eq!(kinds, [JobKind::Render, JobKind::Train]);
    assert!(busy.last_seen.is_some());

    let mut jobs = service.jobs();
    let mut named = async |states: &[job::State]| {
        let request = ListJobsRequest {
            states: states.iter().map(|&state| state.into()).collect(),
            ..ListJobsRequest::default()
        };
        let listed = jobs.list_jobs(request).await.expect("lists").into_inner();
        listed.jobs.len()
    };
    assert_eq!(named(&[]).await, 3, "and the ingest");
    assert_eq!(named(&[job::State::Running]).await, 1);
    assert_eq!(named(&[job::State::Running, job::State::Queued]).await, 2);
    assert_eq!(named(&[job::State::Failed]).await, 0);
    let many = ListJobsRequest {
        states: vec![job::State::Queued.into(); 40_000],
        kinds: vec![JobKind::Train.into(); 40_000],
        ..ListJobsRequest::default()
    };
    let listed = service.jobs().list_jobs(many).await;
    assert_eq!(listed.expect("lists").into_inner().jobs.len(), 1);
    let request = ListJobsRequest {
        states: vec![99],
        ..ListJobsRequest::default()
    };
    let refused = service.jobs().list_jobs(request).await;
    assert_invalid(refused, "states");

    // The progress of a job that succeeded is complete.
    let checkpoint = service.publish(&lease, 40).await.expect("publishes");
    let progress = Progress {
        fraction: 0.7,
        seconds_left: Some(3.0),
        step: 40,
        ..Progress::default()
    };
    let beat = HeartbeatRequest {
        claim: Some(claim(&lease)),
        progress: Some(progress),
    };
    service.workers().heartbeat(beat).await.expect("in time");
    let result = yoto_proto::v1::TrainResult {
        checkpoint: checkpoint.name,
        ..<_>::default()
    };
    let result = job_result::Kind::Train(result);
    service.complete(&lease, result).await.expect("completes");
    let ended = service.get_job(&first.name).await.progress.expect("some");
    assert_eq!(
        (ended.fraction, ended.seconds_left, ended.step),
        (1.0, Some(0.0), 40)
    );
}

/// A subject whose capture has `frames` frames, from number 5 on.
async fn filmed(service: &Service, name: &str, frames: u32) -> Subject {
    let subject = service.subject(name).await;
    let uploaded = service.upload_good(&subject.name).await;
    let worker = service.worker(&["ingest"]).await;
    let lease = service.lease(&worker).await.expect("the ingest job waits");
    let capture = uploaded.name;
    let id = |name: &str| name.split('/').next_back().unwrap_or_default().to_owned();
    let key = keys::shard(&id(&capture), &id(&job_name(&lease)), lease.token);
    let result = IngestResult {
        shard: Some(service.put(&key, b"shard").await),
        frames,
        width: 8,
        height: 8,
        first_frame: Some(5),
        last_frame: Some(4 + frames),
        ..IngestResult::default()
    };
    let result = job_result::Kind::Ingest(result);
    service.complete(&lease, result).await.expect("completes");
    let ready = service.get_capture(&capture).await;
    assert_eq!(
        (ready.first_frame, ready.last_frame),
        (Some(5), Some(4 + frames))
    );
    service.get_subject(&subject.name).await
}

#[tokio::test]
async fn requests_that_no_worker_could_serve_are_refused_at_once() {
    let service = Service::start().await;
    let ada = filmed(&service, "ada", 10).await;
    let model = service.model_of(&ada).await;
    let render = async |subject: &Subject, frame| {
        let spec = RenderSpec {
            model: model.name.clone(),
            subject: subject.name.clone(),
            what: Some(What::Orbit(Orbit {
                frame,
                views: 1,
                size: 64,
            })),
            ..RenderSpec::default()
        };
        let request = CreateRenderRequest {
            spec: Some(spec),
            ..<_>::default()
        };
        service.renders().create_render(request).await
    };
    for frame in [4, 15, 1000] {
        let status = render(&ada, frame).await.expect_err("is refused");
        assert!(status.message().contains("frames 5 to 14"), "{status:?}");
    }
    assert_refused(
        render(&ada, 14).await,
        Code::FailedPrecondition,
        "NO_CHECKPOINT",
    );

    // Errors use display names.
    let dan = filmed(&service, "dan", 1).await;
    let status = render(&dan, 5).await.expect_err("is refused");
    assert!(
        status.message().contains("dan is not in shared"),
        "{status:?}"
    );
    let model = service.model_of(&dan).await;
    let spec = TrainSpec {
        model: model.name,
        ..TrainSpec::default()
    };
    let refused = service.create_job(job_spec::Kind::Train(spec)).await;
    let status = refused.expect_err("one frame is too few");
    assert!(
        status.message().contains("the capture of dan has 1 frame"),
        "{status:?}"
    );

    let request = CreateSubjectRequest {
        display_name: "a,b".into(),
        ..<_>::default()
    };
    let refused = service.subjects().create_subject(request).await;
    assert_invalid(refused, "display_name");
}
