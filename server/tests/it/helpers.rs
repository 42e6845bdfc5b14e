//! Several workers at one render: each has its own lease and draws its own ranges.

use crate::support::{Service, assert_invalid, assert_refused, id, job_error, job_name};
use std::collections::BTreeMap;
use std::sync::Arc;
use tonic::{Code, Status};
use yoto_proto::keys;
use yoto_proto::v1::job_attempt::Outcome as Ended;
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::{
    CancelJobRequest, CreateJobRequest, Job, JobKind, JobPriority, JobResult, JobSpec,
    ListObjectsRequest, Model, Orbit, PauseJobsRequest, Progress, RenderResult, RenderSpec,
    RenderedFile, ResumeJobsRequest, Subject, job, job_result, job_spec,
};
use yoto_proto::worker::v1::end_job_request::{Cancelled, Outcome, Returned};
use yoto_proto::worker::v1::{
    Claim, CommitOutputRequest, EndJobRequest, HeartbeatRequest, Lease, TakeRangeRequest,
    TakeRangeResponse,
};
use yoto_server::clock::ManualClock;

/// Length of a lease, seconds.
const LEASE: f64 = 20.0;
const STALE: &str = "STALE_LEASE";
/// Pictures of the render, in ranges of 4, 4 and 2.
const PICTURES: u32 = 10;
/// Maximum number of pictures of a render.
const MOST: u32 = 10_000;
/// Pictures of a range of such a render: it has at most 64 ranges.
const LONGEST: u32 = 157;

/// A service with a trained person, and a clock that moves only when it is told to.
struct Stage {
    service: Service,
    clock: Arc<ManualClock>,
    model: Model,
    subject: Subject,
}

/// A worker and its lease.
struct Hand {
    name: String,
    lease: Lease,
}

impl Stage {
    async fn new() -> Self {
        let clock = Arc::new(ManualClock::at(1e9));
        let own = clock.clone();
        let service = Service::start_with(move |config| {
            config.clock = own;
            config.lease_seconds = LEASE;
        })
        .await;
        let subject = service.ready_subject("Ada").await;
        let model = service.model_of(&subject).await;
        let stage = Self {
            service,
            clock,
            model,
            subject,
        };
        stage.train(1, 25.0).await;
        stage
    }

    /// Trains the model up to a checkpoint at `step`.
    async fn train(&self, step: u64, psnr: f64) {
        let service = &self.service;
        service.train(&self.model).await;
        let trainer = service.worker(&["train"]).await;
        let lease = service.lease(&trainer).await.expect("the training waits");
        let published = service.publish_with(&lease, step, psnr).await;
        let checkpoint = published.expect("publishes");
        service.complete_training(&lease, &checkpoint).await;
    }

    async fn render(&self, priority: JobPriority) -> Job {
        let spec = RenderSpec {
            model: self.model.name.clone(),
            subject: self.subject.name.clone(),
            what: Some(What::Orbit(Orbit {
                frame: 0,
                views: PICTURES,
                size: 8,
            })),
            ..RenderSpec::default()
        };
        let request = CreateJobRequest {
            spec: Some(JobSpec {
                kind: Some(job_spec::Kind::Render(spec)),
            }),
            priority: priority.into(),
            ..CreateJobRequest::default()
        };
        let job = self.service.jobs().create_job(request).await;
        job.expect("is queued").into_inner()
    }

    /// A new worker with a lease; `None` if there is no work.
    async fn hand(&self) -> Option<Hand> {
        let name = self.service.worker(&["render"]).await;
        let lease = self.service.lease_or_help(&name, "", true).await?;
        Some(Hand { name, lease })
    }

    /// The worker that runs a new render, with its first range, and one that helps.
    async fn two(&self) -> (Hand, Hand) {
        self.render(JobPriority::Normal).await;
        let first = self.hand().await.expect("the render waits");
        assert!(!first.lease.helps);
        self.take(&first, None).await.expect("has the first range");
        let second = self.hand().await.expect("pictures are left");
        assert!(second.lease.helps);
        (first, second)
    }

    async fn take(&self, hand: &Hand, drawn: Option<u32>) -> Result<TakeRangeResponse, Status> {
        self.take_of(PICTURES, hand, drawn).await
    }

    /// The same of a render with this number of `pictures`.
    async fn take_of(
        &self,
        pictures: u32,
        hand: &Hand,
        drawn: Option<u32>,
    ) -> Result<TakeRangeResponse, Status> {
        let request = TakeRangeRequest {
            claim: Some(hand.claim()),
            pictures,
            drawn,
        };
        let taken = self.service.workers().take_range(request).await;
        taken.map(|answer| answer.into_inner())
    }

    /// Commits the picture at `index`.
    async fn draw(&self, hand: &Hand, index: u32) -> Result<RenderedFile, Status> {
        let file = keys::picture(index);
        let key = keys::render(id(&job_name(&hand.lease)), hand.lease.token, &file);
        let object = Some(self.service.put(&key, file.as_bytes()).await);
        let file = RenderedFile { file, object };
        let request = CommitOutputRequest {
            claim: Some(hand.claim()),
            file: Some(file.clone()),
        };
        self.service.workers().commit_output(request).await?;
        Ok(file)
    }

    async fn draw_all(&self, hand: &Hand, taken: &TakeRangeResponse) -> u32 {
        let range = taken.range.expect("a range");
        for index in range.first..range.first + range.count {
            self.draw(hand, index).await.expect("commits");
        }
        range.first
    }

    async fn heartbeat(&self, hand: &Hand, step: u64) -> Result<bool, Status> {
        let request = HeartbeatRequest {
            claim: Some(hand.claim()),
            progress: Some(Progress {
                step,
                ..Progress::default()
            }),
        };
        let answer = self.service.workers().heartbeat(request).await;
        answer.map(|answer| answer.into_inner().cancel)
    }

    async fn end(&self, hand: &Hand, outcome: Outcome) -> Result<(), Status> {
        let request = EndJobRequest {
            claim: Some(hand.claim()),
            outcome: Some(outcome),
        };
        self.service.workers().end_job(request).await.map(drop)
    }

    /// Lets time pass in steps too short for an outage, while `alive` renew their leases.
    async fn pass(&self, seconds: f64, alive: &[&Hand]) {
        let mut left = seconds;
        while left > 0.0 {
            let step = left.min(LEASE / 4.0);
            self.clock.advance(step);
            for hand in alive {
                self.heartbeat(hand, 1).await.expect("holds its lease");
            }
            let looked = self.service.coordinator.look_after_leases().await;
            looked.expect("looks");
            left -= step;
        }
    }

    async fn cancel(&self, job: &str) -> Job {
        let request = CancelJobRequest {
            name: job.into(),
            request_id: job.into(),
        };
        let answer = self.service.jobs().cancel_job(request).await;
        answer.expect("is heard").into_inner()
    }

    /// Checks that every write of the worker is refused with a stale lease.
    async fn assert_late(&self, hand: &Hand) {
        let refused = |answer| assert_refused(answer, Code::FailedPrecondition, STALE);
        refused(self.heartbeat(hand, 1).await.map(drop));
        refused(self.take(hand, None).await.map(drop));
        refused(self.draw(hand, 0).await.map(drop));
        refused(self.end(hand, succeeded(Vec::new())).await);
        let failed = Outcome::Failed(job_error("INTERNAL", "late"));
        refused(self.end(hand, failed).await);
    }
}

impl Hand {
    fn claim(&self) -> Claim {
        Claim {
            job: job_name(&self.lease),
            worker: self.name.clone(),
            token: self.lease.token,
        }
    }
}

fn succeeded(files: Vec<RenderedFile>) -> Outcome {
    let result = RenderResult {
        files,
        ..RenderResult::default()
    };
    Outcome::Succeeded(JobResult {
        kind: Some(job_result::Kind::Render(result)),
    })
}

fn range(taken: &TakeRangeResponse) -> Option<(u32, u32)> {
    taken.range.map(|it| (it.first, it.count))
}

async fn history(stage: &Stage, job: &str) -> Vec<(u64, Ended)> {
    let attempts = stage.service.get_job(job).await.attempts;
    attempts
        .iter()
        .map(|it| (it.number, it.outcome()))
        .collect()
}

#[tokio::test]
async fn two_workers_draw_every_picture_of_a_render_once() {
    let stage = Stage::new().await;
    let (first, second) = stage.two().await;
    let job = job_name(&first.lease);
    assert!(first.lease.token < second.lease.token);
    assert_eq!(second.lease.inputs, first.lease.inputs);
    let own = stage.take(&first, None).await.expect("again");
    assert_eq!(range(&own), Some((0, 4)), "a repeated call");
    let others = stage.take(&second, None).await.expect("the next range");
    assert_eq!(range(&others), Some((4, 4)));
    // Uncommitted files of a helper are not garbage.
    let key = keys::render(id(&job), second.lease.token, "unfinished");
    stage.service.put(&key, b"half").await;
    stage.service.collect(false, true).await;
    assert!(stage.service.has(&key));
    stage.heartbeat(&first, 3).await.expect("is heard");
    stage.heartbeat(&second, 9).await.expect("is heard");
    let drawn = stage.draw_all(&second, &others).await;
    let running = stage.service.get_job(&job).await;
    assert_eq!(running.progress.expect("of the first").step, 3);
    assert_eq!((running.outputs, running.worker), (4, first.name.clone()));
    let last = stage.take(&second, Some(drawn)).await.expect("the last");
    assert_eq!((range(&last), last.committed), (Some((8, 2)), 4));
    let drawn = stage.draw_all(&first, &own).await;
    let none = stage.take(&first, Some(drawn)).await.expect("answers");
    assert_eq!((range(&none), none.finished), (None, false));
    let drawn = stage.draw_all(&second, &last).await;
    let all = stage.take(&second, Some(drawn)).await.expect("answers");
    assert_eq!((range(&all), all.finished), (None, true));
    let end = stage.end(&second, succeeded(Vec::new()));
    end.await.expect("ends its own lease alone");
    assert_eq!(
        stage.service.get_job(&job).await.state(),
        job::State::Running
    );

    let all = stage.take(&first, None).await.expect("answers");
    let files = all.outputs.clone();
    let keys_by_file: BTreeMap<&str, &str> = (files.iter())
        .map(|it| (&*it.file, it.object.as_ref().map_or("", |it| &it.key)))
        .collect();
    assert_eq!((files.len(), keys_by_file.len()), (10, 10));
    for (index, (file, key)) in keys_by_file.into_iter().enumerate() {
        let hand = if index < 4 { &first } else { &second };
        assert_eq!(key, keys::render(id(&job), hand.lease.token, file));
    }
    stage
        .end(&first, succeeded(files))
        .await
        .expect("completes");
    let expected = [(1, Ended::Succeeded), (2, Ended::Helped)];
    assert_eq!(history(&stage, &job).await, expected);
    let repeated = stage.end(&second, succeeded(Vec::new()));
    repeated.await.expect("is a repetition");
    let request = ListObjectsRequest {
        parent: job,
        ..ListObjectsRequest::default()
    };
    let listed = stage.service.objects().list_objects(request).await;
    assert_eq!(listed.expect("lists").into_inner().objects.len(), 10);
}

#[tokio::test]
async fn a_number_of_pictures_beyond_the_limit_is_refused() {
    let stage = Stage::new().await;
    stage.render(JobPriority::Normal).await;
    let hand = stage.hand().await.expect("the render waits");
    for pictures in [0, MOST + 1, u32::MAX] {
        assert_invalid(stage.take_of(pictures, &hand, None).await, "pictures");
    }
    // The last file is that of a picture of another range.
    for index in [1, 3, LONGEST] {
        stage.draw(&hand, index).await.expect("commits");
    }
    let taken = stage.take_of(MOST, &hand, None).await;
    let taken = taken.expect("has the first range");
    assert_eq!((range(&taken), taken.committed), (Some((0, LONGEST)), 3));
    let files: Vec<_> = taken.outputs.iter().map(|it| it.file.as_str()).collect();
    assert_eq!(files, ["000001.png", "000003.png"]);
}

#[tokio::test]
async fn the_pictures_of_a_lost_helper_go_to_another_worker_and_its_late_writes_nowhere() {
    let stage = Stage::new().await;
    let (first, second) = stage.two().await;
    let job = job_name(&first.lease);
    stage.take(&second, None).await.expect("has a range");
    let early = stage.draw(&second, 4).await.expect("commits");
    stage.pass(LEASE * 1.5, &[&first]).await;
    let running = stage.service.get_job(&job).await;
    let seen = (running.state(), running.lost_workers);
    assert_eq!(seen, (job::State::Running, 1), "it goes on");
    stage.assert_late(&second).await;

    stage.take(&first, Some(0)).await.expect("the lost range");
    let taken = stage.take(&first, None).await.expect("the same");
    assert_eq!((range(&taken), taken.outputs), (Some((4, 4)), vec![early]));
    let expected = [(1, Ended::Running), (2, Ended::Lost)];
    assert_eq!(history(&stage, &job).await, expected);
    // A lost helper that comes back gets other work, but not this render.
    let again = stage.service.lease_or_help(&second.name, "", true).await;
    assert_eq!(again, None);
    assert!(stage.hand().await.expect("pictures are left").lease.helps);
}

#[tokio::test]
async fn helpers_go_on_when_the_worker_that_runs_the_render_is_lost() {
    let stage = Stage::new().await;
    let (first, second) = stage.two().await;
    let job = job_name(&first.lease);
    let taken = stage.take(&second, None).await.expect("has a range");
    // A better checkpoint comes, which the next lease must not begin to use.
    stage.train(2, 40.0).await;
    stage.pass(LEASE * 1.5, &[&second]).await;
    assert_eq!(
        stage.service.get_job(&job).await.state(),
        job::State::Queued
    );
    stage.assert_late(&first).await;
    let drawn = stage.draw_all(&second, &taken).await;
    // The range of the lost worker comes first.
    let next = stage.take(&second, Some(drawn)).await.expect("goes on");
    assert_eq!(range(&next), Some((0, 4)));
    let third = stage.hand().await.expect("the render waits");
    assert!(!third.lease.helps);
    assert!(third.lease.token > second.lease.token);
    let used = |hand: &Hand| hand.lease.inputs.clone().expect("inputs").checkpoints[0].step;
    assert_eq!((used(&second), used(&third)), (1, 1));
    let rest = stage.take(&third, None).await.expect("has the rest");
    assert_eq!((range(&rest), rest.committed), (Some((8, 2)), 4));
    stage.draw_all(&second, &next).await;
}

#[tokio::test]
async fn the_end_of_a_render_ends_the_leases_of_its_helpers() {
    let stage = Stage::new().await;
    let (first, second) = stage.two().await;
    let job = job_name(&first.lease);
    let early = stage.end(&second, Outcome::Cancelled(Cancelled {})).await;
    assert_refused(early, Code::FailedPrecondition, "CANCEL_NOT_REQUESTED");
    stage.cancel(&job).await;
    assert!(stage.heartbeat(&second, 1).await.expect("is told"));
    assert!(stage.hand().await.is_none(), "nobody else helps");
    let cancelled = stage.end(&first, Outcome::Cancelled(Cancelled {}));
    cancelled.await.expect("is cancelled");
    let expected = [(1, Ended::Cancelled), (2, Ended::Cancelled)];
    assert_eq!(history(&stage, &job).await, expected);
    stage.assert_late(&second).await;

    // While no worker runs it.
    let (first, second) = stage.two().await;
    let job = job_name(&first.lease);
    let returned = stage.end(&first, Outcome::Returned(Returned {}));
    returned.await.expect("is returned");
    stage.heartbeat(&second, 1).await.expect("goes on");
    assert_eq!(stage.cancel(&job).await.state(), job::State::Cancelled);
    stage.assert_late(&second).await;
}

#[tokio::test]
async fn a_worker_helps_when_nothing_else_waits_for_it() {
    let stage = Stage::new().await;
    let service = &stage.service;
    let urgent = stage.render(JobPriority::Urgent).await.name;
    let first = stage.hand().await.expect("the render waits");
    assert!(stage.hand().await.is_none(), "it was not divided yet");
    stage.take(&first, None).await.expect("divides it");
    // Helping comes before jobs of a lower priority only.
    let lower = stage.render(JobPriority::High).await.name;
    let helper = stage.hand().await.expect("pictures are left");
    assert_eq!(
        (job_name(&helper.lease), helper.lease.helps),
        (urgent, true)
    );
    let equal = stage.render(JobPriority::Urgent).await.name;
    for (waits, help) in [(equal, true), (lower, false)] {
        let plain = service.worker(&["render"]).await;
        let lease = service.lease_or_help(&plain, "", help).await;
        assert_eq!(lease.map(|it| job_name(&it)), Some(waits));
    }
    let (plain, trainer) = (
        service.worker(&["render"]).await,
        service.worker(&["train"]).await,
    );
    assert_eq!(service.lease(&plain).await, None, "it did not offer help");
    let lease = service.lease_or_help(&trainer, "", true).await;
    assert_eq!(lease, None, "it draws nothing");
    let kind = JobKind::Render.into();
    let pause = PauseJobsRequest {
        kind,
        reason: "maintenance".into(),
    };
    service.jobs().pause_jobs(pause).await.expect("pauses");
    assert!(stage.hand().await.is_none(), "renders are paused");
    let resume = ResumeJobsRequest { kind };
    service.jobs().resume_jobs(resume).await.expect("resumes");

    // A helper that failed at it is not used again, and the job does not fail.
    let failed = Outcome::Failed(job_error("INTERNAL", "no memory"));
    stage.end(&helper, failed).await.expect("ends");
    let job = service.get_job(&job_name(&first.lease)).await;
    assert_eq!(job.state(), job::State::Running);
    let again = service.lease_or_help(&helper.name, "", true).await;
    assert_eq!(again, None);

    // A repeated call gets the lost answer.
    let name = service.worker(&["render"]).await;
    let lease = service.lease_or_help(&name, "call", true).await;
    let again = service.lease_or_help(&name, "call", true).await;
    let [lease, again] = [lease, again].map(|it| it.map(|it| (it.token, it.helps)));
    assert!(lease.is_some_and(|(token, helps)| helps && token > first.lease.token));
    assert_eq!(lease, again);
}
