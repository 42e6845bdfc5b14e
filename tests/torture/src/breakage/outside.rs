//! Faults of what several coordinators share, and of the ways between processes.

use super::coordinators::healthy;
use super::{Breaker, PATIENCE};
use crate::fault::Fault;
use crate::history::Event;
use crate::observer::newest_attempt;
use crate::proxy::Gate;
use crate::workload::is_ended;
use anyhow::{Context, Result, ensure};
use rand::RngExt;
use std::sync::Arc;
use std::time::{Duration, Instant};
use yoto_test_postgres::Database;
use yoto_test_s3::S3Fault;

/// Longest wait for an answer that should not come.
const NO_ANSWER: Duration = Duration::from_millis(500);
/// Requests of the store that fail before it works again, at least.
const REFUSED: u64 = 4;

impl Breaker {
    /// Does something to the database that blocks.
    async fn with_database(&self, what: impl FnOnce(&Database) + Send + 'static) -> Result<()> {
        let fleet = Arc::clone(&self.fleet);
        let done = tokio::task::spawn_blocking(move || {
            let database = fleet.outside().database.as_ref();
            database.map(what).context("no database of PostgreSQL")
        });
        done.await?
    }

    /// A part of two leases: shorter and longer than one.
    fn while_away(&mut self) -> Duration {
        self.fleet
            .lease()
            .mul_f64(self.chance.random_range(0.3..2.0))
    }

    /// A database whose processes stand still answers nobody, and later goes on where it was.
    pub(super) async fn stop_database(&mut self) -> Result<()> {
        let away = self.while_away();
        self.with_database(|it| it.stop(true)).await?;
        let silent = self.nobody_answers().await;
        tokio::time::sleep(away).await;
        self.with_database(|it| it.stop(false)).await?;
        silent?;
        self.back(Fault::DatabaseStopped).await
    }

    /// All connections to a database that crashes break, and transactions without a commit are gone.
    pub(super) async fn crash_database(&mut self) -> Result<()> {
        let away = self.while_away();
        self.with_database(Database::crash).await?;
        let silent = self.nobody_answers().await;
        tokio::time::sleep(away).await;
        self.with_database(Database::restart).await?;
        silent?;
        self.back(Fault::DatabaseCrashed).await
    }

    /// Checks that no coordinator answers a question to the database. An answer that is lost on purpose is none, so each is
    /// asked several times.
    async fn nobody_answers(&self) -> Result<()> {
        for (number, calls) in self.each.iter().enumerate() {
            for _ in 0..3 {
                ensure!(
                    !calls.answers(NO_ANSWER).await,
                    "coordinator {number} answered without a database"
                );
            }
        }
        Ok(())
    }

    /// The outside works again: waits until all coordinators do, and until an upload succeeds.
    async fn back(&self, fault: Fault) -> Result<()> {
        let back = Instant::now();
        self.broken(fault)?;
        for calls in &self.each {
            healthy(calls, true).await?;
        }
        self.recovered(fault, back)?;
        self.workload.person(0).await?;
        Ok(())
    }

    fn recovered(&self, fault: Fault, since: Instant) -> Result<()> {
        self.history.record(Event::Recovered {
            fault,
            seconds: since.elapsed().as_secs_f64(),
        })
    }

    /// How a way is closed: its packets are dropped, or its connections end.
    fn closed(&mut self) -> Gate {
        match self.chance.random_bool(0.5) {
            true => Gate::Held,
            false => Gate::Refused,
        }
    }

    /// A coordinator without its way to the database says so, the others go on, and what it had begun is not carried out
    /// under leases that were lost meanwhile.
    pub(super) async fn cut_from_database(&mut self) -> Result<()> {
        let (job, _) = self.training().await?;
        let (number, away, gate) = (self.any_coordinator(), self.while_away(), self.closed());
        self.fleet.set_way_to_database(number, gate)?;
        let noticed = healthy(&self.each[number], false).await;
        let served = self.others_serve(number).await;
        tokio::time::sleep(away).await;
        self.fleet.set_way_to_database(number, Gate::Open)?;
        noticed?;
        served?;
        let back = Instant::now();
        self.broken(Fault::DatabaseCut)?;
        healthy(&self.each[number], true).await?;
        self.recovered(Fault::DatabaseCut, back)?;
        self.late(&job.name).await
    }

    /// A worker whose coordinator is out of reach goes on by another one.
    pub(super) async fn cut_from_coordinator(&mut self) -> Result<()> {
        let (job, worker) = self.training().await?;
        let gate = self.closed();
        let proxies = self.fleet.proxies(&worker);
        let used = proxies.iter().position(|it| it.open() > 0);
        let used = used.with_context(|| format!("{worker} has no connection"))?;
        let others = || {
            let others = proxies.iter().enumerate().filter(|it| it.0 != used);
            others.map(|(_, proxy)| proxy.opened()).sum::<usize>()
        };
        let (before, cut) = (others(), Instant::now());
        proxies[used].set(gate);
        while others() == before && cut.elapsed() < PATIENCE {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        let moved = others() > before;
        let again = match moved {
            true => self.goes_on(&job).await,
            false => Ok(()),
        };
        proxies[used].set(Gate::Open);
        ensure!(moved, "{worker} did not move to another coordinator");
        again?;
        self.broken(Fault::CoordinatorCut)?;
        self.recovered(Fault::CoordinatorCut, cut)?;
        self.late(&job.name).await
    }

    /// Waits until a job was renewed, leased again, or has ended.
    async fn goes_on(&self, job: &yoto_proto::v1::Job) -> Result<()> {
        let began = Instant::now();
        loop {
            let now = self.calls.job(&job.name).await?;
            let moved = now.sequence > job.sequence || newest_attempt(&now) > newest_attempt(job);
            if moved || is_ended(now.state()) {
                return Ok(());
            }
            ensure!(began.elapsed() < PATIENCE, "{} stands still", job.name);
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }

    /// A store that answers 503 to everybody: coordinators say so, jobs wait, and nothing fails.
    pub(super) async fn refuse_objects(&mut self) -> Result<()> {
        let away = self.while_away();
        let store = self.fleet.outside().store.as_ref();
        let store = store.context("no store of objects in S3")?;
        // One that starts meanwhile does not serve at all.
        for calls in &self.each {
            healthy(calls, true).await?;
        }
        let (before, began) = (store.failed(), Instant::now());
        store.fail(S3Fault::Unavailable);
        let mut noticed = Ok(());
        for calls in &self.each {
            noticed = noticed.and(healthy(calls, false).await);
        }
        while store.failed() < before + REFUSED && began.elapsed() < PATIENCE {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        tokio::time::sleep(away).await;
        let refused = store.failed() - before;
        store.heal();
        noticed?;
        ensure!(refused >= REFUSED, "the store was asked {refused} times");
        self.back(Fault::StoreUnavailable).await
    }
}
