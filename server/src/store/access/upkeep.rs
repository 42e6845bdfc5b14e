//! What the service does by itself, for all tenants: time, lost workers, garbage.

use crate::rules::steps::Reading;
use crate::store::scripts::reaping::Lost;
use crate::store::scripts::steps::Checks;
use crate::store::scripts::{attempts, garbage, reaping, requests, steps, uploads, workers};
use crate::store::{Horizons, KnownGarbage, Reaped, Reference, Store, StoreError};

impl Store {
    /// Extends all deadlines by an outage since the last call, then takes back jobs with expired leases. A job
    /// that lost `cap` workers without a checkpoint in between FAILS.
    pub async fn tick(&self, cap: u32, lease_seconds: f64) -> Result<Vec<Reaped>, StoreError> {
        if !reaping::is_due(&mut self.db.read().await?, lease_seconds).await? {
            return Ok(Vec::new());
        }
        let mut tx = self.db.write().await?;
        let lost = reaping::tick(&mut tx, lease_seconds).await?;
        tx.commit().await?;
        self.take_back(&lost, cap).await
    }

    /// Takes back the jobs of workers that ran in an earlier process of the coordinator.
    pub async fn take_back_embedded(&self, cap: u32) -> Result<Vec<Reaped>, StoreError> {
        let lost = reaping::embedded(&mut self.db.read().await?).await?;
        self.take_back(&lost, cap).await
    }

    /// Ends lost leases, each in a transaction of its own, so that each locks one job.
    async fn take_back(&self, lost: &[Lost], cap: u32) -> Result<Vec<Reaped>, StoreError> {
        let mut reaped = Vec::with_capacity(lost.len());
        for lost in lost {
            let mut tx = self.db.write().await?;
            reaped.extend(reaping::take_back(&mut tx, lost, cap).await?);
            tx.commit().await?;
        }
        Ok(reaped)
    }

    /// Deletes rows that are older than their horizon. Returns the number of rows.
    pub async fn forget(&self, horizons: Horizons) -> Result<u64, StoreError> {
        let now = self.keep_time().await?;
        let mut tx = self.db.write().await?;
        let requests = requests::forget(&mut tx, horizons.request_ids, now).await?;
        let attempts = attempts::forget(&mut tx, horizons.attempts, now).await?;
        let workers = workers::forget(&mut tx, horizons.workers, now).await?;
        tx.commit().await?;
        Ok(requests + attempts + workers)
    }

    /// Ends the open uploads without a write for `idle_seconds`, and notes their objects as garbage. Returns
    /// their ids.
    pub async fn expire_uploads(&self, idle_seconds: f64) -> Result<Vec<String>, StoreError> {
        let now = self.keep_time().await?;
        let mut tx = self.db.write().await?;
        let ended = uploads::expire(&mut tx, idle_seconds, now).await?;
        tx.commit().await?;
        Ok(ended)
    }

    /// The folders that were noted as garbage.
    pub async fn garbage(&self) -> Result<Vec<KnownGarbage>, StoreError> {
        let now = self.keep_time().await?;
        garbage::known(&mut self.db.read().await?, now).await
    }

    /// What refers to each of these folders of the object store.
    pub async fn references(
        &self,
        folders: &[String],
        keep_uploads: f64,
    ) -> Result<Vec<Reference>, StoreError> {
        let now = self.keep_time().await?;
        garbage::references(&mut self.db.read().await?, folders, keep_uploads, now).await
    }

    /// Releases the files of an upload for their removal: no ingest job reads them from now on. Returns whether they are
    /// garbage still.
    pub async fn release_upload(
        &self,
        capture: &str,
        keep_uploads: f64,
    ) -> Result<bool, StoreError> {
        let now = self.keep_time().await?;
        let mut tx = self.db.write().await?;
        let released = garbage::release_upload(&mut tx, capture, keep_uploads, now).await?;
        tx.commit().await?;
        Ok(released)
    }

    /// Notes the `new` folders as garbage, and deletes the notes of the `gone` ones.
    pub async fn note_garbage(&self, new: &[String], gone: &[String]) -> Result<(), StoreError> {
        let mut tx = self.db.write().await?;
        garbage::note(&mut tx, new, gone).await?;
        tx.commit().await
    }

    /// Records the time, and a step of the clock since the last call, so that ages of rows count only running time.
    /// Returns the time. The health check calls it to find whether writes succeed.
    pub async fn keep_time(&self) -> Result<f64, StoreError> {
        // Held until the step is recorded, so that no other call records it again.
        let mut checks = self.checks.lock().await;
        let mut tx = self.db.write().await?;
        let reading = Reading {
            now: tx.now(),
            steady: self.db.clock().steady(),
        };
        let (step, since) = steps::keep_time(&mut tx, *checks, reading).await?;
        tx.commit().await?;
        if let (Some(step), true) = (step, checks.is_some()) {
            let seconds = step.seconds;
            tracing::warn!(
                seconds,
                "the clock was set, or the machine slept: this time does not count for ages"
            );
        }
        *checks = Some(Checks {
            since,
            last: reading,
        });
        Ok(since.expected(reading.steady))
    }
}
