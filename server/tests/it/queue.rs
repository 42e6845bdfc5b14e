//! The queue: its order, pauses, and inputs that were chosen when a job was queued.

use crate::support::{
    Service, Trained, assert_invalid, assert_refused, claim, eventually, id, job_name,
};
use tonic::Code;
use yoto_proto::keys;
use yoto_proto::v1::status_service_client::StatusServiceClient;
use yoto_proto::v1::{
    CreateJobRequest, GetStatusRequest, Job, JobKind, JobPriority, JobSpec, JobView,
    ListJobsRequest, ListObjectsRequest, ListWorkersRequest, Model, PauseJobsRequest, RenderedFile,
    ResumeJobsRequest, TrainSpec, WorkerDevice, job, job_result, job_spec,
};
use yoto_proto::worker::v1::end_job_request::{Outcome, Returned};
use yoto_proto::worker::v1::{CommitOutputRequest, Lease, RegisterWorkerRequest};

async fn train_for(service: &Service, model: &Model, owner: &str, priority: JobPriority) -> Job {
    let train = TrainSpec {
        model: model.name.clone(),
        seconds: 1.0,
        ..<_>::default()
    };
    let request = CreateJobRequest {
        spec: Some(JobSpec {
            kind: Some(job_spec::Kind::Train(train)),
        }),
        owner: owner.into(),
        priority: priority.into(),
        ..<_>::default()
    };
    let created = service.jobs().create_job(request).await;
    created.expect("is queued").into_inner()
}

async fn give_back(service: &Service, lease: &Lease) {
    let returned = Outcome::Returned(Returned {});
    service.end(lease, returned).await.expect("is recorded");
}

#[tokio::test]
async fn a_model_has_one_trainer_at_a_time_and_a_job_given_back_keeps_its_place() {
    let service = Service::start().await;
    let subject = service.ready_subject("Ada").await;
    let one = service.model_of(&subject).await;
    let first = service.train(&one).await;
    let second = service.train(&one).await;
    assert_eq!(service.get_job(&second.name).await.queue_position, 1);
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the first waits");
    assert_eq!(job_name(&lease), first.name);
    assert_eq!(
        service.lease(&worker).await,
        None,
        "the model is being trained"
    );
    let other = service.train(&service.model_of(&subject).await).await;
    let beside = service.lease(&worker).await;
    let beside = beside.expect("another model may be trained");
    assert_eq!(job_name(&beside), other.name);

    give_back(&service, &lease).await;
    let back = service.get_job(&first.name).await;
    assert_eq!((back.state(), back.lost_workers), (job::State::Queued, 0));
    let lease = service.lease(&worker).await.expect("the first waits again");
    assert_eq!(job_name(&lease), first.name);
    let checkpoint = service.publish(&lease, 1).await.expect("publishes");
    service.complete_training(&lease, &checkpoint).await;
    let lease = service.lease(&worker).await.expect("now the second");
    assert_eq!(job_name(&lease), second.name);
}

#[tokio::test(flavor = "multi_thread")]
async fn workers_that_ask_at_once_never_get_the_same_job() {
    let service = Service::start().await;
    let mut queued = Vec::new();
    for n in 0..6 {
        let subject = service.subject(&format!("person {n}")).await;
        queued.push(service.upload_good(&subject.name).await.ingest_job);
    }
    let worker = service.worker(&["ingest"]).await;
    let asked = (0..20).map(|_| service.lease(&worker));
    let leases = futures::future::join_all(asked).await;
    let mut leased: Vec<_> = leases.iter().flatten().map(job_name).collect();
    leased.sort();
    queued.sort();
    assert_eq!(leased, queued);
}

/// The positions of the listed jobs of trainings, newest first.
async fn positions(service: &Service, owner: &str) -> Vec<u32> {
    let request = ListJobsRequest {
        kinds: vec![JobKind::Train.into()],
        owner: owner.to_owned(),
        ..ListJobsRequest::default()
    };
    let list = service.jobs().list_jobs(request).await;
    let jobs = list.expect("is listed").into_inner().jobs;
    jobs.iter().map(|job| job.queue_position).collect()
}

#[tokio::test]
async fn priority_comes_first_then_the_owner_with_the_fewest_jobs_then_age() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let mut queued = Vec::new();
    for (owner, priority) in [
        ("busy", JobPriority::Low),
        ("busy", JobPriority::Normal),
        ("busy", JobPriority::Unspecified),
        ("busy", JobPriority::Normal),
        ("rare", JobPriority::Normal),
        ("rare", JobPriority::Urgent),
    ] {
        let model = service.model_of(&ada).await;
        queued.push(train_for(&service, &model, owner, priority).await.name);
    }
    assert_eq!(service.get_job(&queued[0]).await.queue_position, 5);
    assert_eq!(positions(&service, "").await, [0, 4, 3, 2, 1, 5]);
    assert_eq!(positions(&service, "rare").await, [0, 4]);
    let worker = service.worker(&["train"]).await;
    let mut order = Vec::new();
    while let Some(lease) = service.lease(&worker).await {
        let name = job_name(&lease);
        order.push(queued.iter().position(|it| *it == name).expect("is known"));
    }
    // The urgent job makes "rare" the owner with more running jobs, until "busy" has caught up.
    assert_eq!(order, [5, 1, 2, 4, 3, 0]);
}

#[tokio::test]
async fn a_paused_kind_waits_and_the_others_go_on() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let model = service.model_of(&ada).await;
    service.train(&model).await;
    let worker = service.worker(&["train", "ingest"]).await;
    let request = PauseJobsRequest {
        kind: JobKind::Train.into(),
        reason: "a new GPU is built in".into(),
    };
    service.jobs().pause_jobs(request).await.expect("pauses");
    assert_eq!(service.lease(&worker).await, None);
    let bob = service.subject("Bob").await;
    service.upload_good(&bob.name).await;
    service.lease(&worker).await.expect("ingest goes on");
    let mut status = StatusServiceClient::new(service.channel.clone());
    let told = status.get_status(GetStatusRequest {}).await.expect("tells");
    let paused = told.into_inner().paused;
    assert_eq!((paused.len(), paused[0].kind()), (1, JobKind::Train));
    assert_eq!(paused[0].reason, "a new GPU is built in");
    let request = ResumeJobsRequest {
        kind: JobKind::Train.into(),
    };
    service.jobs().resume_jobs(request).await.expect("resumes");
    service.lease(&worker).await.expect("the training waits");
    let nothing = ResumeJobsRequest { kind: 0 };
    assert_invalid(service.jobs().resume_jobs(nothing).await, "kind");
}

#[tokio::test]
async fn a_job_uses_the_captures_of_the_day_it_was_queued() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let model = service.model_of(&ada).await;
    service.train(&model).await;
    let trainer = service.worker(&["train"]).await;
    let first = service.lease(&trainer).await.expect("waits");
    let shard = |lease: &Lease| lease.inputs.clone().expect("has inputs").shards[0].clone();
    let before = shard(&first);
    give_back(&service, &first).await;
    // A newer capture of the same person.
    service.upload_good(&ada.name).await;
    let worker = service.worker(&["ingest"]).await;
    let lease = service.lease(&worker).await.expect("waits");
    service.complete_ingest(&lease).await;
    let again = service.lease(&trainer).await.expect("waits");
    assert_eq!(shard(&again), before);
    let checkpoint = service.publish(&again, 1).await.expect("publishes");
    service.complete_training(&again, &checkpoint).await;
    service.train(&model).await;
    let next = service.lease(&trainer).await.expect("waits");
    assert_ne!(shard(&next).shard, before.shard);
}

#[tokio::test]
async fn a_job_without_its_inputs_fails_and_does_not_stand_before_the_others() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let broken = service.train(&service.model_of(&ada).await).await;
    let other = service.train(&service.model_of(&ada).await).await;
    // Only a damaged database can leave a job without captures.
    let job = id(&broken.name);
    let damage = |spec| format!("UPDATE jobs SET spec = {spec} WHERE id = '{job}'");
    let (sqlite, postgres) = (damage("x'ff'"), damage(r"'\xff'"));
    service.database.run_either(&sqlite, &postgres).await;
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the other one waits");
    assert_eq!(job_name(&lease), other.name);
    let request = ListJobsRequest {
        states: vec![job::State::Failed.into()],
        ..<_>::default()
    };
    let failed = service.jobs().list_jobs(request).await.expect("lists");
    let failed = &failed.into_inner().jobs[0];
    assert_eq!(failed.name, broken.name);
    let error = failed.error.clone().expect("says why");
    assert_eq!(error.code, "INPUTS");
}

#[tokio::test]
async fn lists_are_filtered_and_leave_orders_out_unless_asked() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let (one, two) = (service.model_of(&ada).await, service.model_of(&ada).await);
    let first = train_for(&service, &one, "ada", JobPriority::Normal).await;
    let second = train_for(&service, &two, "bob", JobPriority::High).await;
    let list = async |request: ListJobsRequest| {
        let listed = service.jobs().list_jobs(request).await.expect("lists");
        listed.into_inner().jobs
    };
    let all = list(ListJobsRequest::default()).await;
    assert_eq!(all.len(), 3, "and the ingest");
    assert!(all.iter().all(|job| job.spec.is_none()));
    assert_eq!(
        (all[0].priority(), &*all[0].model),
        (JobPriority::High, &*two.name)
    );
    let of_bob = ListJobsRequest {
        owner: "bob".into(),
        view: JobView::Full.into(),
        ..<_>::default()
    };
    let of_bob = list(of_bob).await;
    assert_eq!((of_bob.len(), &of_bob[0].name), (1, &second.name));
    assert_eq!(of_bob[0].spec, second.spec);
    let of_one = ListJobsRequest {
        model: one.name.clone(),
        kinds: vec![JobKind::Train.into()],
        ..<_>::default()
    };
    assert_eq!(list(of_one).await[0].name, first.name);
    let request = ListJobsRequest {
        kinds: vec![77],
        ..<_>::default()
    };
    assert_invalid(service.jobs().list_jobs(request).await, "kinds");
}

#[tokio::test]
async fn pictures_of_a_render_are_seen_one_by_one_and_made_once() {
    let service = Service::start().await;
    let Trained {
        subject: ada,
        model,
        worker,
        training,
        checkpoint,
    } = service.trained().await;
    service.complete_training(&training, &checkpoint).await;
    let job = service.render(&model, &ada, "").await;
    let first = service.lease(&worker).await.expect("waits");
    let commit = async |lease: &Lease, file: &str, key: String| {
        let file = RenderedFile {
            file: file.into(),
            object: Some(service.put(&key, b"picture").await),
        };
        let request = CommitOutputRequest {
            claim: Some(claim(lease)),
            file: Some(file.clone()),
        };
        let answer = service.workers().commit_output(request).await;
        answer.map(|_| file)
    };
    let key = |token, file: &str| keys::render(id(&job.name), token, file);
    let early = commit(&first, "0.png", key(first.token, "0.png")).await;
    let early = early.expect("commits");
    let strange = commit(&first, "1.png", key(first.token + 1, "1.png")).await;
    assert_invalid(strange, "file.object.key");
    let seen = async || {
        let request = ListObjectsRequest {
            parent: job.name.clone(),
            ..<_>::default()
        };
        let listed = service.objects().list_objects(request).await;
        let listed = listed.expect("lists").into_inner().objects;
        let files: Vec<String> = listed.into_iter().map(|it| it.file).collect();
        files
    };
    assert_eq!(seen().await, ["0.png"]);
    assert_eq!(service.get_job(&job.name).await.outputs, 1);

    give_back(&service, &first).await;
    service.collect(false, true).await;
    let second = service.lease(&worker).await.expect("waits");
    let committed = second.inputs.clone().expect("has inputs").outputs;
    assert_eq!(committed.as_slice(), std::slice::from_ref(&early));
    assert!(service.has(&early.object.clone().expect("has one").key));
    let late = commit(&second, "1.png", key(second.token, "1.png")).await;
    let result = yoto_proto::v1::RenderResult {
        files: vec![early, late.expect("commits")],
        ..<_>::default()
    };
    let kind = job_result::Kind::Render(result);
    service.complete(&second, kind).await.expect("completes");
    assert_eq!(seen().await, ["0.png", "1.png"]);
    service.collect(false, true).await;
    assert!(service.has(&key(first.token, "0.png")));
}

#[tokio::test]
async fn a_coordinator_that_starts_takes_back_the_jobs_of_its_own_worker_at_once() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let own = service.train(&service.model_of(&ada).await).await;
    let elsewhere = service.train(&service.model_of(&ada).await).await;
    let embedded = service.embedded_worker().await;
    let remote = service.worker(&["train"]).await;
    service.lease(&embedded).await.expect("waits");
    service.lease(&remote).await.expect("waits");
    let dir = service.stop().await;
    let service = Service::start_in(dir, |_| {}).await;
    let job = service.get_job(&own.name).await;
    assert_eq!((job.state(), job.lost_workers), (job::State::Queued, 1));
    let job = service.get_job(&elsewhere.name).await;
    assert_eq!((job.state(), job.lost_workers), (job::State::Running, 0));
    let mut status = StatusServiceClient::new(service.channel.clone());
    let workers = status.list_workers(ListWorkersRequest::default()).await;
    let workers = workers.expect("lists").into_inner().workers;
    let running = workers.iter().find(|it| it.name == remote);
    assert_eq!(running.expect("is listed").job, elsewhere.name);
    let again = eventually("the next lease", || service.lease(&remote)).await;
    assert_eq!(job_name(&again), own.name);
}

#[tokio::test]
async fn who_is_trained_alone_needs_a_trained_model_and_no_capture_but_their_own() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let bob = service.ready_subject("Bob").await;
    let model = service.model_of(&ada).await;
    let alone = |only: &str| {
        let train = TrainSpec {
            model: model.name.clone(),
            only: only.into(),
            ..<_>::default()
        };
        service.create_job(job_spec::Kind::Train(train))
    };
    let precondition = Code::FailedPrecondition;
    assert_refused(alone(&bob.name).await, precondition, "NO_SLOT");
    let model = service.joined(model.clone(), &bob).await;
    assert_refused(alone(&bob.name).await, precondition, "NO_CHECKPOINT");
    let worker = service.worker(&["train"]).await;
    let (training, checkpoint) = service.train_to(&model, &worker, 1).await;
    service.complete_training(&training, &checkpoint).await;
    alone(&bob.name).await.expect("is queued");
    let lease = service.lease(&worker).await.expect("the second waits");
    let inputs = lease.inputs.expect("has inputs");
    let whose: Vec<&str> = inputs.shards.iter().map(|it| &*it.subject).collect();
    assert_eq!(whose, [&*bob.name]);
    assert_eq!(inputs.model.expect("a model").slots.len(), 2);
}

#[tokio::test]
async fn a_worker_gets_no_order_that_it_does_not_understand() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let job = service.train(&service.model_of(&ada).await).await;
    // As a worker of a version that sends no level.
    let request = RegisterWorkerRequest {
        display_name: "old".into(),
        device: Some(WorkerDevice::default()),
        kinds: vec![JobKind::Train.into()],
        version: "0.0.9".into(),
        ..RegisterWorkerRequest::default()
    };
    let old = service.workers().register_worker(request).await;
    let old = old.expect("registers").into_inner().worker;
    assert_eq!(service.lease(&old).await, None);
    let mut status = StatusServiceClient::new(service.channel.clone());
    let workers = status.list_workers(ListWorkersRequest::default()).await;
    let workers = workers.expect("lists").into_inner().workers;
    let listed = workers.iter().find(|it| it.name == old).expect("is listed");
    assert_eq!((&*listed.version, listed.order_level), ("0.0.9", 0));
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    assert_eq!(job_name(&lease), job.name);
}
