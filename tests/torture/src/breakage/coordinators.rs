//! Faults of coordinators.

use super::{Breaker, PATIENCE};
use crate::calls::Calls;
use crate::fault::Fault;
use anyhow::{Result, ensure};
use rand::RngExt;
use std::time::{Duration, Instant};

/// Calls at whose commit or answer a coordinator ends.
const CALLS: [&str; 4] = ["EndJob", "LeaseJob", "Heartbeat", "PublishCheckpoint"];
/// Longest wait for an answer of a coordinator whose neighbour is gone.
const ANSWER: Duration = Duration::from_secs(2);

impl Breaker {
    /// One of several coordinators stays away for a while, in which the others serve.
    pub(super) async fn kill_coordinator(&mut self) -> Result<()> {
        let wait = Duration::from_millis(self.chance.random_range(0..800));
        tokio::time::sleep(wait).await;
        let number = self.any_coordinator();
        let alone = self.each.len() == 1;
        self.fleet.kill_coordinator(number, !alone)?;
        self.broken(Fault::CoordinatorKilled)?;
        if alone {
            return Ok(());
        }
        let served = self.others_serve(number).await;
        let away = self
            .fleet
            .lease()
            .mul_f64(self.chance.random_range(0.5..2.0));
        tokio::time::sleep(away).await;
        self.fleet.let_start(number);
        served?;
        healthy(&self.each[number], true).await
    }

    /// The number of any coordinator.
    pub(super) fn any_coordinator(&mut self) -> usize {
        self.chance.random_range(0..self.each.len())
    }

    /// Checks that each coordinator but the one with this number answers questions to the database.
    pub(super) async fn others_serve(&self, number: usize) -> Result<()> {
        for (other, calls) in self.each.iter().enumerate().filter(|it| it.0 != number) {
            let began = Instant::now();
            // Each twentieth answer is lost on purpose.
            while !calls.answers(ANSWER).await {
                ensure!(
                    began.elapsed() < 5 * ANSWER,
                    "coordinator {other} does not answer while {number} is gone"
                );
            }
        }
        Ok(())
    }

    /// The process notes the fault itself.
    pub(super) async fn end_coordinator(&mut self, fault: Fault) -> Result<()> {
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

    pub(super) async fn jump(&mut self, fault: Fault, seconds: f64) -> Result<()> {
        // Those of several coordinators are apart then.
        let number = self.any_coordinator();
        let controls = self.fleet.controls();
        controls.set_clock(number, controls.clock(number) + seconds)?;
        self.broken(fault)?;
        // Long enough that leases which do not follow the clock are lost.
        tokio::time::sleep(self.fleet.lease()).await;
        Ok(())
    }

    /// A coordinator with a full disk reports that it is unhealthy, and recovers without a restart once there is room.
    pub(super) async fn fill_database(&self) -> Result<()> {
        let controls = self.fleet.controls();
        controls.set_full(true)?;
        let noticed = healthy(&self.calls, false).await;
        if noticed.is_ok() {
            // A lease, after which jobs without a heartbeat are lost.
            tokio::time::sleep(self.fleet.lease()).await;
        }
        controls.set_full(false)?;
        noticed?;
        self.broken(Fault::DatabaseFull)?;
        healthy(&self.calls, true).await?;
        self.workload.person(0).await?;
        Ok(())
    }
}

/// Waits until the health that `calls` gets is `wanted`.
pub(super) async fn healthy(calls: &Calls, wanted: bool) -> Result<()> {
    let began = Instant::now();
    while calls.health().await != Some(wanted) {
        ensure!(
            began.elapsed() < PATIENCE,
            "waiting until the health is {wanted}"
        );
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    Ok(())
}
