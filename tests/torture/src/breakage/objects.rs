//! Faults of disks and of stored objects.

use super::{Breaker, PATIENCE};
use crate::fault::Fault;
use crate::history::Event;
use crate::parts::StoreFault;
use crate::workload::{is_ended, render, train};
use anyhow::{Context, Result, bail, ensure};
use nix::sys::signal::Signal;
use std::time::{Duration, Instant};
use yoto_proto::manifest::{Manifest, files};
use yoto_proto::v1::{JobAttempt, job, job_attempt, job_result};

/// Largest file of a worker with a full disk, bytes.
const FULL: u64 = 4096;

impl Breaker {
    /// The workers note each faulty call.
    pub(super) async fn break_store(&self, kind: StoreFault) -> Result<()> {
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
    pub(super) async fn fill_disk(&self) -> Result<()> {
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

    /// Asks for trainings until the `worker` with the full disk has postponed one.
    pub(super) async fn postponed(&self, model: &str, worker: &str) -> Result<String> {
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
    pub(super) async fn flip_bit(&self) -> Result<()> {
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
        let objects = self.fleet.outside().objects();
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
}
