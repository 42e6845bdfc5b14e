//! A render with its workers.

use crate::support::{Service, assert_refused, id, job_error, job_name};
use std::sync::Arc;
use tonic::{Code, Status};
use yoto_proto::keys;
use yoto_proto::v1::job_attempt::Outcome as Ended;
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::{
    CancelJobRequest, CreateJobRequest, Job, JobPriority, JobResult, JobSpec, Model, Orbit,
    Progress, RenderResult, RenderSpec, RenderedFile, Subject, job_result, job_spec,
};
use yoto_proto::worker::v1::end_job_request::Outcome;
use yoto_proto::worker::v1::{
    Claim, CommitOutputRequest, EndJobRequest, HeartbeatRequest, Lease, TakeRangeRequest,
    TakeRangeResponse,
};
use yoto_server::clock::ManualClock;

/// Length of a lease, seconds.
pub(super) const LEASE: f64 = 20.0;

pub(super) const STALE: &str = "STALE_LEASE";

/// Pictures of the render, in ranges of 4, 4 and 2.
pub(super) const PICTURES: u32 = 10;

/// Maximum number of pictures of a render.
pub(super) const MOST: u32 = 10_000;

/// Pictures of a range of such a render: it has at most 64 ranges.
pub(super) const LONGEST: u32 = 157;

/// A service with a trained person, and a clock that moves only when it is told to.
pub(super) struct Stage {
    pub(super) service: Service,
    pub(super) clock: Arc<ManualClock>,
    pub(super) model: Model,
    pub(super) subject: Subject,
}

/// A worker and its lease.
pub(super) struct Hand {
    pub(super) name: String,
    pub(super) lease: Lease,
}

impl Stage {
    pub(super) async fn new() -> Self {
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
    pub(super) async fn train(&self, step: u64, psnr: f64) {
        let service = &self.service;
        service.train(&self.model).await;
        let trainer = service.worker(&["train"]).await;
        let lease = service.lease(&trainer).await.expect("the training waits");
        let published = service.publish_with(&lease, step, psnr).await;
        let checkpoint = published.expect("publishes");
        service.complete_training(&lease, &checkpoint).await;
    }

    pub(super) async fn render(&self, priority: JobPriority) -> Job {
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
    pub(super) async fn hand(&self) -> Option<Hand> {
        let name = self.service.worker(&["render"]).await;
        let lease = self.service.lease_or_help(&name, "", true).await?;
        Some(Hand { name, lease })
    }

    /// The worker that runs a new render, with its first range, and one that helps.
    pub(super) async fn two(&self) -> (Hand, Hand) {
        self.render(JobPriority::Normal).await;
        let first = self.hand().await.expect("the render waits");
        assert!(!first.lease.helps);
        self.take(&first, None).await.expect("has the first range");
        let second = self.hand().await.expect("pictures are left");
        assert!(second.lease.helps);
        (first, second)
    }

    pub(super) async fn take(
        &self,
        hand: &Hand,
        drawn: Option<u32>,
    ) -> Result<TakeRangeResponse, Status> {
        self.take_of(PICTURES, hand, drawn).await
    }

    /// The same of a render with this number of `pictures`.
    pub(super) async fn take_of(
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
    pub(super) async fn draw(&self, hand: &Hand, index: u32) -> Result<RenderedFile, Status> {
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

    pub(super) async fn draw_all(&self, hand: &Hand, taken: &TakeRangeResponse) -> u32 {
        let range = taken.range.expect("a range");
        for index in range.first..range.first + range.count {
            self.draw(hand, index).await.expect("commits");
        }
        range.first
    }

    pub(super) async fn heartbeat(&self, hand: &Hand, step: u64) -> Result<bool, Status> {
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

    pub(super) async fn end(&self, hand: &Hand, outcome: Outcome) -> Result<(), Status> {
        let request = EndJobRequest {
            claim: Some(hand.claim()),
            outcome: Some(outcome),
        };
        self.service.workers().end_job(request).await.map(drop)
    }

    /// Lets time pass in steps too short for an outage, while `alive` renew their leases.
    pub(super) async fn pass(&self, seconds: f64, alive: &[&Hand]) {
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

    pub(super) async fn cancel(&self, job: &str) -> Job {
        let request = CancelJobRequest {
            name: job.into(),
            request_id: job.into(),
        };
        let answer = self.service.jobs().cancel_job(request).await;
        answer.expect("is heard").into_inner()
    }

    /// Checks that every write of the worker is refused with a stale lease.
    pub(super) async fn assert_late(&self, hand: &Hand) {
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
    pub(super) fn claim(&self) -> Claim {
        Claim {
            job: job_name(&self.lease),
            worker: self.name.clone(),
            token: self.lease.token,
        }
    }
}

pub(super) fn succeeded(files: Vec<RenderedFile>) -> Outcome {
    let result = RenderResult {
        files,
        ..RenderResult::default()
    };
    Outcome::Succeeded(JobResult {
        kind: Some(job_result::Kind::Render(result)),
    })
}

pub(super) fn range(taken: &TakeRangeResponse) -> Option<(u32, u32)> {
    taken.range.map(|it| (it.first, it.count))
}

pub(super) async fn history(stage: &Stage, job: &str) -> Vec<(u64, Ended)> {
    let attempts = stage.service.get_job(job).await.attempts;
    attempts
        .iter()
        .map(|it| (it.number, it.outcome()))
        .collect()
}
