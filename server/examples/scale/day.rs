//! The simulated time: events in their order.

use crate::Plan;
use crate::costs::{Begun, Costs};
use crate::stage::{OWNERS, Result, Stage, claim};
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap, HashSet};
use std::fmt;
use yoto_proto::keys;
use yoto_proto::manifest::{Manifest, ManifestObject, VERSION, files};
use yoto_proto::names::{self, Collection};
use yoto_proto::v1::{
    Checkpoint, GetJobRequest, JobKind, ListJobsRequest, Progress, TrainResult, job, job_result,
};
use yoto_proto::worker::v1::{HeartbeatRequest, Lease, PublishCheckpointRequest};
use yoto_server::clock::ManualClock;

/// Seconds between two requests of a worker that found no job, between two reports on a job, from a lease to its first
/// checkpoint and between later ones, between two searches for lost workers: those of the real ones.
const POLL: f64 = 2.0;
const BEAT: f64 = 0.5;
const FIRST_SAVE: f64 = 5.0;
const SAVE: f64 = 30.0;
const TICK: f64 = 0.5;
/// Seconds between two looks of a person at a job, and at a page of the list.
const LOOK: f64 = 2.0;
const LIST: f64 = 30.0;
/// Seconds until another worker comes in place of a lost one.
const REPLACED: f64 = 60.0;

/// What happens next to a worker, a person or the service.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Event {
    Tick,
    Ask(usize),
    Beat(usize, u64),
    Save(usize, u64),
    End(usize, u64),
    Lost(usize, u64),
    Look(usize),
    List(usize),
}

/// A worker.
struct Worker {
    name: String,
    lease: Option<Lease>,
    /// Number of its last report, which counts as a step.
    step: u64,
    /// When the lease began.
    since: f64,
}

/// A simulation.
pub(crate) struct Day<'a> {
    stage: &'a Stage,
    clock: &'a ManualClock,
    plan: &'a Plan,
    jobs: &'a [String],
    events: BinaryHeap<Reverse<(u64, u64, Event)>>,
    /// Microseconds since the begin.
    now: u64,
    number: u64,
    random: u64,
    workers: Vec<Worker>,
    running: HashSet<String>,
    done: HashSet<String>,
    report: Report,
}

/// What a simulation has shown.
#[derive(Default)]
pub(crate) struct Report {
    /// Simulated seconds.
    pub span: f64,
    trained: usize,
    asked: usize,
    without: usize,
    lost: usize,
    computed: f64,
    workers: usize,
    /// Largest difference of running trainings between two owners while all of them wait.
    unfair: usize,
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let used = self.computed / (self.span * self.workers as f64) * 1e2;
        write!(
            f,
            "{} trainings SUCCEEDED once each, {:.0} simulated seconds, workers busy for {used:.1} %; {} requests for a job, {} \
             without success; {} workers lost with their leases; owners differ by {} running trainings at most",
            self.trained, self.span, self.asked, self.without, self.lost, self.unfair
        )
    }
}

impl<'a> Day<'a> {
    pub(crate) fn new(
        stage: &'a Stage,
        clock: &'a ManualClock,
        plan: &'a Plan,
        jobs: &'a [String],
    ) -> Self {
        Self {
            stage,
            clock,
            plan,
            jobs,
            events: BinaryHeap::new(),
            now: 0,
            number: 0,
            random: 1,
            workers: Vec::new(),
            running: HashSet::new(),
            done: HashSet::new(),
            report: Report::default(),
        }
    }

    /// Simulates until all trainings have ended.
    pub(crate) async fn run(mut self, costs: &mut Costs) -> Result<Report> {
        for number in 0..self.plan.workers {
            let name = self.stage.register(number, JobKind::Train).await?;
            self.workers.push(Worker {
                name,
                lease: None,
                step: 0,
                since: 0.0,
            });
            let after = POLL * self.chance();
            self.add(after, Event::Ask(number));
        }
        for person in 0..self.plan.watchers {
            let (look, list) = (LOOK * self.chance(), LIST * self.chance());
            self.add(look, Event::Look(person));
            self.add(list, Event::List(person));
        }
        self.add(TICK, Event::Tick);
        while self.done.len() < self.jobs.len() {
            let Some(Reverse((at, _, event))) = self.events.pop() else {
                return Err("nothing happens any more".into());
            };
            self.clock.advance((at - self.now) as f64 * 1e-6);
            self.now = at;
            self.happen(event, costs).await?;
        }
        self.check().await?;
        self.report.span = self.seconds();
        self.report.workers = self.plan.workers;
        self.report.trained = self.done.len();
        Ok(self.report)
    }

    fn seconds(&self) -> f64 {
        self.now as f64 * 1e-6
    }

    fn add(&mut self, after: f64, event: Event) {
        self.number += 1;
        let at = self.now + (after * 1e6) as u64;
        self.events.push(Reverse((at, self.number, event)));
    }

    /// A number from 0 to 1 (<https://prng.di.unimi.it/splitmix64.c>).
    fn chance(&mut self) -> f64 {
        self.random = self.random.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.random;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) as f64 / u64::MAX as f64
    }

    async fn happen(&mut self, event: Event, costs: &mut Costs) -> Result<()> {
        match event {
            Event::Tick => {
                for coordinator in &self.stage.coordinators {
                    let looked = coordinator.look_after_leases();
                    costs.time("search for lost workers", looked).await?;
                }
                self.add(TICK, Event::Tick);
            }
            Event::Ask(worker) => self.ask(worker, costs).await?,
            Event::Look(person) => {
                let at = (self.chance() * (self.jobs.len() - 1) as f64) as usize;
                let name = self.jobs[at].clone();
                let mut jobs = self.stage.jobs(person);
                let got = jobs.get_job(GetJobRequest { name });
                costs.time("GetJob", got).await?;
                self.add(LOOK, Event::Look(person));
            }
            Event::List(person) => {
                let mut jobs = self.stage.jobs(person);
                let listed = jobs.list_jobs(ListJobsRequest::default());
                costs.time("page of 100 jobs", listed).await?;
                self.add(LIST, Event::List(person));
            }
            Event::Beat(worker, token) if self.has(worker, token) => {
                self.workers[worker].step += 1;
                self.beat(worker, costs).await?;
                self.add(BEAT, Event::Beat(worker, token));
            }
            Event::Save(worker, token) if self.has(worker, token) => {
                self.save(worker, costs).await?;
                self.add(SAVE, Event::Save(worker, token));
            }
            Event::End(worker, token) if self.has(worker, token) => self.end(worker, costs).await?,
            Event::Lost(worker, token) if self.has(worker, token) => {
                let lease = self.workers[worker].lease.take();
                self.running.remove(&job_of(&lease));
                self.report.lost += 1;
                self.workers[worker].name = self.stage.register(worker, JobKind::Train).await?;
                self.add(REPLACED, Event::Ask(worker));
            }
            Event::Beat(..) | Event::Save(..) | Event::End(..) | Event::Lost(..) => {}
        }
        Ok(())
    }

    /// Whether the worker has this lease.
    fn has(&self, worker: usize, token: u64) -> bool {
        let lease = &self.workers[worker].lease;
        lease.as_ref().is_some_and(|it| it.token == token)
    }

    async fn ask(&mut self, worker: usize, costs: &mut Costs) -> Result<()> {
        self.report.asked += 1;
        let name = self.workers[worker].name.clone();
        let begun = Begun::now();
        let lease = self.stage.lease(worker, &name).await?;
        let kind = match &lease {
            Some(_) => "lease",
            None => "request without success",
        };
        costs.ended(kind, &begun);
        let Some(lease) = lease else {
            self.report.without += 1;
            self.add(POLL, Event::Ask(worker));
            return Ok(());
        };
        let job = lease.job.as_ref().map(|it| it.name.clone());
        let job = job.unwrap_or_default();
        // A job that comes back from a lost worker may come to a second one, never beside the first.
        if !self.running.insert(job.clone()) || self.done.contains(&job) {
            return Err(format!("{job} was leased twice").into());
        }
        let token = lease.token;
        let state = &mut self.workers[worker];
        (state.lease, state.step) = (Some(lease), 0);
        state.since = self.now as f64 * 1e-6;
        let seconds = self.plan.seconds * (0.8 + 0.4 * self.chance());
        self.report.computed += seconds;
        self.add(BEAT, Event::Beat(worker, token));
        self.add(FIRST_SAVE, Event::Save(worker, token));
        self.add(seconds, Event::End(worker, token));
        if self.chance() * (self.plan.lost as f64) < 1.0 {
            let after = seconds * self.chance();
            self.add(after, Event::Lost(worker, token));
        }
        self.compare();
        Ok(())
    }

    /// Notes how far owners differ while each of them has trainings that wait.
    fn compare(&mut self) {
        let mut owners = BTreeMap::from_iter((0..OWNERS).map(|it| (it, (0, 0))));
        for (number, job) in self.jobs.iter().enumerate() {
            let of_owner = owners.entry(number % OWNERS).or_default();
            match (self.running.contains(job), self.done.contains(job)) {
                (true, _) => of_owner.0 += 1,
                (false, false) => of_owner.1 += 1,
                (false, true) => {}
            }
        }
        if owners.values().all(|(_, waiting)| *waiting > 0) {
            let running = owners.values().map(|(running, _)| *running);
            let (most, least) = (running.clone().max(), running.min());
            let differ = most.unwrap_or(0) - least.unwrap_or(0);
            self.report.unfair = self.report.unfair.max(differ);
        }
    }

    async fn beat(&self, worker: usize, costs: &mut Costs) -> Result<()> {
        let it = &self.workers[worker];
        let Some(lease) = &it.lease else {
            return Ok(());
        };
        let request = HeartbeatRequest {
            claim: Some(claim(&it.name, lease)),
            progress: Some(Progress {
                step: it.step,
                total_steps: 1000,
                train_seconds: self.seconds() - it.since,
                loss: Some(0.1),
                ..Progress::default()
            }),
        };
        let mut workers = self.stage.workers(worker);
        costs.time("heartbeat", workers.heartbeat(request)).await?;
        Ok(())
    }

    /// Publishes a checkpoint, of which the name is returned.
    async fn save(&self, worker: usize, costs: &mut Costs) -> Result<String> {
        let it = &self.workers[worker];
        let lease = it.lease.as_ref().ok_or("it has a lease")?;
        let model = lease.inputs.as_ref().and_then(|it| it.model.as_ref());
        let model = model.ok_or("a training has a model")?;
        let (model_id, job) = (Collection::Models.parse(&model.name)?, job_of(&it.lease));
        let job_id = Collection::Jobs.parse(&job)?;
        let step = it.step + 1;
        let folder = keys::checkpoint(model_id, job_id, lease.token, step);
        let key = format!("{folder}/{}", files::WEIGHTS);
        let weights = self.stage.put(&key, b"weights").await?;
        let manifest = Manifest {
            version: VERSION,
            model: model.name.clone(),
            step,
            job: it.name.clone(),
            job_seconds: 1.0,
            job_steps: step,
            objects: vec![ManifestObject {
                file: files::WEIGHTS.to_owned(),
                key: weights.key,
                bytes: weights.bytes,
                sha256: weights.sha256,
            }],
        };
        let key = format!("{folder}/{}", files::MANIFEST);
        let manifest = self
            .stage
            .put(&key, &serde_json::to_vec(&manifest)?)
            .await?;
        let name = names::checkpoint(&model.name, step);
        let request = PublishCheckpointRequest {
            claim: Some(claim(&it.name, lease)),
            checkpoint: Some(Checkpoint {
                name: name.clone(),
                step,
                manifest: Some(manifest),
                bytes: weights.bytes,
                psnr: Some(25.0 + step as f64 * 1e-3),
                slots: vec![0],
                ..Checkpoint::default()
            }),
            save_seconds: 0.5,
        };
        let mut workers = self.stage.workers(worker);
        let published = workers.publish_checkpoint(request);
        costs.time("checkpoint", published).await?;
        Ok(name)
    }

    async fn end(&mut self, worker: usize, costs: &mut Costs) -> Result<()> {
        self.workers[worker].step += 1;
        let checkpoint = self.save(worker, costs).await?;
        let lease = self.workers[worker].lease.take().ok_or("it has a lease")?;
        let result = job_result::Kind::Train(TrainResult {
            checkpoint,
            ..TrainResult::default()
        });
        let name = self.workers[worker].name.clone();
        let ended = self.stage.end(worker, &name, &lease, result);
        costs.time("end of a job", ended).await?;
        let job = job_of(&Some(lease));
        self.running.remove(&job);
        self.done.insert(job);
        self.add(0.0, Event::Ask(worker));
        Ok(())
    }

    /// The service says the same of each training.
    async fn check(&self) -> Result<()> {
        for name in self.jobs {
            let request = GetJobRequest { name: name.clone() };
            let job = self.stage.jobs(0).get_job(request).await?.into_inner();
            if job.state() != job::State::Succeeded {
                return Err(format!("{name} is {}", job.state().as_str_name()).into());
            }
        }
        Ok(())
    }
}

fn job_of(lease: &Option<Lease>) -> String {
    let job = lease.as_ref().and_then(|it| it.job.as_ref());
    job.map(|it| it.name.clone()).unwrap_or_default()
}
