//! Breaks the service in one way, and watches it recover.

use super::calls::Calls;
use super::fault::Fault;
use super::history::{Event, History};
use super::late::write_late;
use super::observer::newest_attempt;
use super::parts::StoreFault;
use super::processes::Fleet;
use super::proxy::Proxy;
use super::workload::{Avatar, Workload, is_ended, render, train};
use anyhow::{Context, Result, bail, ensure};
use nix::sys::signal::Signal;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;
use std::time::{Duration, Instant};
use yoto_proto::manifest::{Manifest, files};
use yoto_proto::v1::{Job, JobAttempt, WatchJobResponse, job, job_attempt, job_result};

/// Longest wait for something that has to happen.
const PATIENCE: Duration = Duration::from_secs(60);
/// A jump of the clock, seconds.
const JUMP: f64 = 3600.0;
/// Calls at whose commit or answer the coordinator ends.
const CALLS: [&str; 4] = ["EndJob", "LeaseJob", "Heartbeat", "PublishCheckpoint"];
/// Largest file of a worker with a full disk, bytes.
const FULL: u64 = 4096;
/// Steps of a training that will lose its worker; they take seconds.
const STEPS: u64 = 100;
/// Watchers of one job that never read.
const SILENT: usize = 20;

/// Breaks things.
pub struct Breaker {
    /// The processes.
    pub fleet: Arc<Fleet>,
    /// People whose trainings lose their workers, one after another, since a model has one trainer at a time;
    /// no other client cancels them.
    pub victims: [Avatar; 2],
    /// A client.
    pub calls: Calls,
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
    /// Watchers that never read.
    pub silent: Vec<tonic::Streaming<WatchJobResponse>>,
}

impl Breaker {
    /// Makes the fault happen, and waits until it is over.
    ///
    /// # Errors
    /// When it does not happen, or the service does not recover.
    pub async fn make(&mut self, fault: Fault) -> Result<()> {
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
            Fault::CallRepeated | Fault::CallLate | Fault::AnswerLost => Ok(()),
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

    async fn kill_worker(&mut self) -> Result<()> {
        let (job, worker) = self.training().await?;
        if !self.fleet.signal_worker(&worker, Signal::SIGKILL)? {
            bail!("{worker} ended by itself");
        }
        let killed = Instant::now();
        self.broken(Fault::WorkerKilled)?;
        if self.leased_again(&job).await? {
            self.history.record(Event::Recovered {
                fault: Fault::WorkerKilled,
                seconds: killed.elapsed().as_secs_f64(),
            })?;
        }
        self.late(&job.name).await
    }

    async fn kill_coordinator(&mut self) -> Result<()> {
        let wait = Duration::from_millis(self.chance.random_range(0..800));
        tokio::time::sleep(wait).await;
        self.fleet.kill_coordinator()?;
        self.broken(Fault::CoordinatorKilled)
    }

    /// The process notes the fault itself.
    async fn end_coordinator(&mut self, fault: Fault) -> Result<()> {
        let call = CALLS[self.chance.random_range(0..CALLS.len())];
        self.fleet.controls().set_end(fault, call)?;
        let (before, began) = (self.noted(fault), Instant::now());
        while self.noted(fault) == before && began.elapsed() < PATIENCE {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        let late = self.fleet.controls().withdraw_end();
        ensure!(!late, "no {call} came, at which to end");
        Ok(())
    }

    fn noted(&self, fault: Fault) -> usize {
        let noted = self.fleet.controls().noted();
        noted.get(&fault).copied().unwrap_or(0)
    }

    async fn stop_worker(&mut self) -> Result<()> {
        let (job, worker) = self.training().await?;
        if !self.fleet.signal_worker(&worker, Signal::SIGSTOP)? {
            bail!("{worker} ended by itself");
        }
        let lease = self.fleet.lease();
        let again = self.leased_again(&job).await;
        tokio::time::sleep(lease / 2).await;
        self.fleet.signal_worker(&worker, Signal::SIGCONT)?;
        ensure!(again?, "{} ended on a stopped worker", job.name);
        self.broken(Fault::WorkerStopped)?;
        self.late(&job.name).await
    }

    /// A worker that can't reach the coordinator loses its job; its later calls are refused.
    async fn part_worker(&mut self) -> Result<()> {
        let (job, worker) = self.training().await?;
        ensure!(self.fleet.hold(&worker, true), "{worker} ended by itself");
        let again = self.leased_again(&job).await;
        self.fleet.hold(&worker, false);
        ensure!(again?, "{} ended on a worker that nobody heard", job.name);
        tokio::time::sleep(self.fleet.lease() / 2).await;
        self.broken(Fault::Partition)?;
        self.late(&job.name).await
    }

    /// A worker whose job's thread hangs ends by itself.
    async fn hang_job(&self) -> Result<()> {
        let controls = self.fleet.controls();
        let (before, gave_up) = (self.noted(Fault::JobHung), self.fleet.gave_up());
        let began = Instant::now();
        controls.set_store(Some(StoreFault::Never))?;
        while self.noted(Fault::JobHung) == before && began.elapsed() < PATIENCE {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
        controls.set_store(None)?;
        while self.fleet.gave_up() == gave_up {
            ensure!(began.elapsed() < 2 * PATIENCE, "no worker has ended");
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
        Ok(())
    }

    async fn jump(&self, fault: Fault, seconds: f64) -> Result<()> {
        let controls = self.fleet.controls();
        controls.set_clock(controls.clock() + seconds)?;
        self.broken(fault)?;
        // Long enough that leases which do not follow the clock are lost.
        tokio::time::sleep(self.fleet.lease()).await;
        Ok(())
    }

    /// A job that ends each of its workers comes to an end itself.
    async fn poison(&self) -> Result<()> {
        let avatar = self.workload.avatar().await?;
        let id = avatar.model.trim_start_matches("models/");
        self.fleet.controls().set_poison(id)?;
        let ended = async {
            let job = self.workload.ask(train(&avatar.model, 30), true).await?;
            let job = job.context("a training")?;
            self.history.record(Event::Doomed { job: job.clone() })?;
            self.workload.wait(&job).await
        };
        let ended = ended.await;
        self.fleet.controls().set_poison("")?;
        let ended = ended?;
        let code = ended.error.as_ref().map(|error| error.code.as_str());
        ensure!(
            code == Some("WORKERS_LOST"),
            "a poisoned job is {} with {:?}",
            ended.state().as_str_name(),
            ended.error
        );
        self.late(&ended.name).await
    }

    async fn cut_upload(&mut self) -> Result<()> {
        let before = self.proxy.cuts();
        let bytes = self.workload.upload_bytes();
        self.proxy.cut_after(self.chance.random_range(1..bytes));
        self.workload.person(0).await?;
        ensure!(self.proxy.cuts() > before, "the upload was not cut");
        self.broken(Fault::UploadCut)
    }

    /// The workers note each faulty call.
    async fn break_store(&self, kind: StoreFault) -> Result<()> {
        let controls = self.fleet.controls();
        let (before, began) = (self.noted(kind.fault()), Instant::now());
        controls.set_store(Some(kind))?;
        while self.noted(kind.fault()) < before + 4 && began.elapsed() < PATIENCE {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        controls.set_store(None)?;
        ensure!(
            self.noted(kind.fault()) > before,
            "the store was never asked"
        );
        Ok(())
    }

    /// A job on a worker with a full disk waits, says why, and continues elsewhere.
    async fn fill_disk(&self) -> Result<()> {
        let avatar = self.workload.avatar().await?;
        let full = self.fleet.start_full(FULL)?;
        let postponed = self.postponed(&avatar.model, &full).await;
        self.fleet.signal_worker(&full, Signal::SIGKILL)?;
        let job = postponed?;
        self.broken(Fault::DiskFull)?;
        let ended = self.workload.wait(&job).await?;
        ensure!(
            ended.state() == job::State::Succeeded,
            "a training that met a full disk is {}: {:?}",
            ended.state().as_str_name(),
            ended.error
        );
        Ok(())
    }

    /// A coordinator with a full disk reports that it is unhealthy, and recovers without a restart once there is room.
    async fn fill_database(&self) -> Result<()> {
        let controls = self.fleet.controls();
        controls.set_full(true)?;
        let noticed = self.healthy(false).await;
        if noticed.is_ok() {
            // A lease, after which jobs without a heartbeat are lost.
            tokio::time::sleep(self.fleet.lease()).await;
        }
        controls.set_full(false)?;
        noticed?;
        self.broken(Fault::DatabaseFull)?;
        self.healthy(true).await?;
        self.workload.person(0).await?;
        Ok(())
    }

    /// Waits until the service's health is `wanted`.
    async fn healthy(&self, wanted: bool) -> Result<()> {
        let began = Instant::now();
        while self.calls.health().await != Some(wanted) {
            ensure!(
                began.elapsed() < PATIENCE,
                "waiting until the health is {wanted}"
            );
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        Ok(())
    }

    /// Asks for trainings until the `worker` with the full disk has postponed one.
    async fn postponed(&self, model: &str, worker: &str) -> Result<String> {
        let began = Instant::now();
        while began.elapsed() < 2 * PATIENCE {
            let job = self.workload.ask(train(model, 20), true).await?;
            let name = job.context("a training")?;
            loop {
                let job = self.calls.job(&name).await?;
                let its = |it: &&JobAttempt| it.worker_display_name == worker;
                if let Some(attempt) = job.attempts.iter().find(its)
                    && attempt.outcome() == job_attempt::Outcome::Postponed
                {
                    let error = attempt.error.clone().unwrap_or_default();
                    ensure!(error.code == "MACHINE", "it waits for {error:?}");
                    return Ok(name);
                }
                if is_ended(job.state()) || began.elapsed() > 2 * PATIENCE {
                    break;
                }
                tokio::time::sleep(Duration::from_millis(100)).await;
            }
        }
        bail!("{worker} never put off a training for its full disk")
    }

    /// The checkpoint before a damaged one is used.
    async fn flip_bit(&self) -> Result<()> {
        let avatar = self.workload.avatar().await?;
        let mut checkpoints = self.calls.checkpoints(&avatar.model).await?;
        let began = Instant::now();
        while checkpoints.len() < 2 {
            ensure!(began.elapsed() < 2 * PATIENCE, "{checkpoints:?}");
            let job = self.workload.ask(train(&avatar.model, 60), true).await?;
            self.workload.wait(&job.context("a training")?).await?;
            checkpoints = self.calls.checkpoints(&avatar.model).await?;
        }
        let newest = checkpoints.iter().max_by_key(|it| it.step);
        let newest = newest.context("a checkpoint")?;
        let manifest = self.fleet.records().manifest(&newest.name).await?;
        let manifest = manifest.context("a manifest")?;
        let objects = self.fleet.objects();
        let bytes = std::fs::read(objects.join(&manifest.key))?;
        let objects_of = Manifest::from_json(&bytes)?.objects;
        let mut objects_of = objects_of.into_iter();
        let weights = objects_of.find(|object| object.file == files::WEIGHTS);
        let key = weights.context("weights")?.key;
        let mut bytes = std::fs::read(objects.join(&key))?;
        let middle = bytes.len() / 2;
        *bytes.get_mut(middle).context("an empty object")? ^= 1;
        std::fs::write(objects.join(&key), bytes)?;
        self.broken(Fault::BitFlipped)?;
        self.history.record(Event::Flipped {
            key,
            checkpoint: newest.name.clone(),
        })?;
        let job = self.workload.ask(render(&avatar, 1), true).await?;
        let ended = self.workload.wait(&job.context("a render")?).await?;
        let result = ended.result.and_then(|result| result.kind);
        let Some(job_result::Kind::Render(result)) = result else {
            bail!("a render beside a damaged checkpoint: {:?}", ended.error);
        };
        self.history.record(Event::Served {
            job: ended.name,
            damaged: newest.name.clone(),
            used: result.checkpoint,
        })
    }

    async fn watch_silently(&mut self) -> Result<()> {
        let job = self.running().await?;
        for _ in 0..SILENT {
            match self.calls.watch(&job.name).await {
                Ok(stream) => self.silent.push(stream),
                // It was deleted.
                Err(status) if status.code() == tonic::Code::NotFound => break,
                Err(status) => return Err(status.into()),
            }
        }
        ensure!(!self.silent.is_empty(), "no watcher");
        self.broken(Fault::SilentWatcher)
    }
}

/// Display name of the worker that runs the job now.
fn running_on(job: &Job) -> Option<String> {
    let newest = job.attempts.last()?;
    let running = newest.outcome() == job_attempt::Outcome::Running;
    running.then(|| newest.worker_display_name.clone())
}
