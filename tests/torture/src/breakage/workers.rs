//! Faults of workers.

use super::{Breaker, PATIENCE};
use crate::fault::Fault;
use crate::history::Event;
use crate::parts::StoreFault;
use crate::workload::train;
use anyhow::{Context, Result, bail, ensure};
use nix::sys::signal::Signal;
use std::time::{Duration, Instant};

impl Breaker {
    pub(super) async fn kill_worker(&mut self) -> Result<()> {
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

    pub(super) async fn stop_worker(&mut self) -> Result<()> {
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
    pub(super) async fn part_worker(&mut self) -> Result<()> {
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
    pub(super) async fn hang_job(&self) -> Result<()> {
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

    /// A job that ends each of its workers comes to an end itself.
    pub(super) async fn poison(&self) -> Result<()> {
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
}
