//! Breaks the service in one way, and watches it recover.

mod callers;
mod clients;
mod coordinators;
mod objects;
mod outside;
mod workers;

pub(crate) use callers::Keys;

use super::calls::Calls;
use super::fault::Fault;
use super::history::{Event, History};
use super::late::write_late;
use super::observer::newest_attempt;
use super::parts::StoreFault;
use super::processes::Fleet;
use super::proxy::Proxy;
use super::workload::{Avatar, Workload, is_ended, train};
use anyhow::{Context, Result, bail, ensure};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;
use std::time::{Duration, Instant};
use yoto_proto::v1::{Job, WatchJobResponse, job, job_attempt};

/// Longest wait for something that has to happen.
const PATIENCE: Duration = Duration::from_secs(60);
/// A jump of the clock, seconds.
const JUMP: f64 = 3600.0;
/// Steps of a training that will lose its worker; they take seconds.
const STEPS: u64 = 100;

/// Breaks things.
pub(crate) struct Breaker {
    /// The processes.
    pub fleet: Arc<Fleet>,
    /// People whose trainings lose their workers, one after another, since a model has one trainer at a time;
    /// no other client cancels them.
    pub victims: [Avatar; 2],
    /// A client.
    pub calls: Calls,
    /// A client of each coordinator alone.
    pub each: Vec<Calls>,
    /// The clients that ask for jobs.
    pub workload: Arc<Workload>,
    /// Proxy for uploads.
    pub proxy: Proxy,
    /// What was seen.
    pub history: Arc<History>,
    /// A worker that never gets a job.
    pub stranger: String,
    /// Choices.
    pub chance: ChaCha8Rng,
    /// The keys of callers at the door.
    pub keys: Keys,
    /// Watchers that never read.
    pub silent: Vec<tonic::Streaming<WatchJobResponse>>,
}

impl Breaker {
    /// Makes the fault happen, and waits until it is over.
    ///
    /// # Errors
    /// When it does not happen, or the service does not recover.
    pub(crate) async fn make(&mut self, fault: Fault) -> Result<()> {
        match fault {
            Fault::WorkerKilled => self.kill_worker().await,
            Fault::CoordinatorKilled => self.kill_coordinator().await,
            Fault::EndBeforeCommit | Fault::EndAfterCommit | Fault::EndBeforeReply => {
                self.end_coordinator(fault).await
            }
            Fault::WorkerStopped => self.stop_worker().await,
            Fault::ClockForward => self.jump(fault, JUMP).await,
            Fault::ClockBack => self.jump(fault, -JUMP).await,
            Fault::Poison => self.poison().await,
            Fault::UploadCut => self.cut_upload().await,
            Fault::StoreError => self.break_store(StoreFault::Error).await,
            Fault::StoreLate => self.break_store(StoreFault::Late).await,
            Fault::StoreHalf => self.break_store(StoreFault::Half).await,
            Fault::DiskFull => self.fill_disk().await,
            Fault::DatabaseFull => self.fill_database().await,
            Fault::BitFlipped => self.flip_bit().await,
            Fault::SilentWatcher => self.watch_silently().await,
            Fault::EmbeddedKilled => super::embedded::kill(&self.fleet, &self.history).await,
            Fault::Partition => self.part_worker().await,
            Fault::JobHung => self.hang_job().await,
            Fault::DatabaseStopped => self.stop_database().await,
            Fault::DatabaseCrashed => self.crash_database().await,
            Fault::DatabaseCut => self.cut_from_database().await,
            Fault::CoordinatorCut => self.cut_from_coordinator().await,
            Fault::StoreUnavailable => self.refuse_objects().await,
            Fault::Strangers => self.strangers().await,
            Fault::GreedyTenant => self.greedy_tenant().await,
            Fault::SlowReaders => self.slow_readers().await,
            Fault::CallRepeated | Fault::CallLate | Fault::AnswerLost | Fault::HintLost => Ok(()),
        }
    }

    fn broken(&self, fault: Fault) -> Result<()> {
        self.history.record(Event::Broken { fault })
    }

    /// A training in the middle of its steps, and the display name of its worker.
    async fn training(&mut self) -> Result<(Job, String)> {
        self.victims.rotate_left(1);
        let began = Instant::now();
        while began.elapsed() < PATIENCE {
            let asked = self
                .workload
                .ask(train(&self.victims[0].model, STEPS), true);
            let name = asked.await?.context("a training")?;
            loop {
                let job = self.calls.job(&name).await?;
                let stepped = job.progress.as_ref().is_some_and(|it| it.step > 0);
                if let Some(worker) = running_on(&job)
                    && stepped
                {
                    return Ok((job, worker));
                }
                if is_ended(job.state()) || began.elapsed() > PATIENCE {
                    break;
                }
                tokio::time::sleep(Duration::from_millis(20)).await;
            }
        }
        bail!("no training was seen at work")
    }

    /// A job that runs.
    async fn running(&self) -> Result<Job> {
        let began = Instant::now();
        while began.elapsed() < PATIENCE {
            for listed in self.calls.list_jobs(&[job::State::Running]).await? {
                let Ok(job) = self.calls.job(&listed.name).await else {
                    continue;
                };
                if running_on(&job).is_some() {
                    return Ok(job);
                }
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        bail!("no job runs")
    }

    /// Waits until `job` has another lease or has ended. Returns whether it has another lease.
    async fn leased_again(&self, job: &Job) -> Result<bool> {
        let (before, began) = (newest_attempt(job), Instant::now());
        loop {
            let now = match self.calls.job(&job.name).await {
                Ok(now) => now,
                // It was deleted.
                Err(status) if status.code() == tonic::Code::NotFound => return Ok(false),
                Err(status) => return Err(status.into()),
            };
            if newest_attempt(&now) > before {
                return Ok(true);
            }
            if is_ended(now.state()) {
                return Ok(false);
            }
            ensure!(
                began.elapsed() < PATIENCE,
                "{} is {} and not leased again",
                job.name,
                now.state().as_str_name()
            );
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }

    async fn late(&self, job: &str) -> Result<()> {
        match self.calls.job(job).await {
            Ok(job) => {
                write_late(
                    &self.calls,
                    &self.history,
                    &self.fleet.records(),
                    &job,
                    &self.stranger,
                )
                .await
            }
            Err(status) if status.code() == tonic::Code::NotFound => Ok(()),
            Err(status) => Err(status.into()),
        }
    }

    fn noted(&self, fault: Fault) -> usize {
        let noted = self.fleet.controls().noted();
        noted.get(&fault).copied().unwrap_or(0)
    }
}

/// Display name of the worker that runs the job now.
fn running_on(job: &Job) -> Option<String> {
    let newest = job.attempts.last()?;
    let running = newest.outcome() == job_attempt::Outcome::Running;
    running.then(|| newest.worker_display_name.clone())
}
