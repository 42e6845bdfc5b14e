//! What the service does by itself, for all tenants: time, lost workers, garbage.

use crate::db::Lock;
use crate::rules::steps::Reading;
use crate::scripts::reaping::Lost;
use crate::scripts::steps::Checks;
use crate::scripts::{
    attempts, audit, garbage, object_store, reaping, requests, steps, uploads, workers,
};
use crate::transaction::transaction;
use crate::{Horizons, KnownGarbage, Reaped, Reference, Store, StoreError};

impl Store {
    /// Extends all deadlines by an outage since the last call, then takes back jobs with expired leases. A job
    /// that lost `cap` workers without a checkpoint in between FAILS.
    pub async fn tick(&self, cap: u32, lease_seconds: f64) -> Result<Vec<Reaped>, StoreError> {
        if !reaping::is_due(&mut self.db.read().await?, lease_seconds).await? {
            return Ok(Vec::new());
        }
        let lost: Result<_, StoreError> = transaction!(self, |tx| async {
            tx.lock(Lock::Reaping).await?;
            reaping::tick(tx, lease_seconds).await
        });
        self.take_back(&lost?, cap).await
    }

    /// The id of the object store of this database. If it has none yet, it gets the one that `mark` tells, which no other
    /// coordinator of this database calls meanwhile. The inner error is that of `mark`, after which it has none.
    pub async fn object_store<F, E>(
        &self,
        mark: impl Fn() -> F,
    ) -> Result<Result<String, E>, StoreError>
    where
        F: Future<Output = Result<String, E>>,
    {
        if let Some(id) = object_store::id(&mut self.db.read().await?).await? {
            return Ok(Ok(id));
        }
        transaction!(self, |tx| async {
            tx.lock(Lock::ObjectStore).await?;
            if let Some(id) = object_store::id(tx).await? {
                return Ok(Ok(id));
            }
            let marked = mark().await;
            if let Ok(id) = &marked {
                object_store::note(tx, id).await?;
            }
            Ok(marked)
        })
    }

    /// Takes back the jobs of workers that ran in an earlier process of the coordinator `instance`.
    pub async fn take_back_embedded(
        &self,
        instance: &str,
        cap: u32,
    ) -> Result<Vec<Reaped>, StoreError> {
        let lost = reaping::embedded(&mut self.db.read().await?, instance).await?;
        self.take_back(&lost, cap).await
    }

    /// Ends lost leases, each in a transaction of its own, so that each locks one job.
    async fn take_back(&self, lost: &[Lost], cap: u32) -> Result<Vec<Reaped>, StoreError> {
        let mut reaped = Vec::with_capacity(lost.len());
        for lost in lost {
            let back: Result<_, StoreError> =
                transaction!(self, |tx| reaping::take_back(tx, lost, cap));
            reaped.extend(back?);
        }
        Ok(reaped)
    }

    /// Deletes rows that are older than their horizon. Returns the number of rows.
    pub async fn forget(&self, horizons: Horizons) -> Result<u64, StoreError> {
        let now = self.keep_time().await?;
        transaction!(self, |tx| async {
            tx.lock(Lock::Forgetting).await?;
            let requests = requests::forget(tx, horizons.request_ids, now).await?;
            let attempts = attempts::forget(tx, horizons.attempts, now).await?;
            let workers = workers::forget(tx, horizons.workers, now).await?;
            let audit = match horizons.audit {
                Some(seconds) => audit::forget_before(tx, now - seconds).await?,
                None => 0,
            };
            Ok(requests + attempts + workers + audit)
        })
    }

    /// Ends the open uploads without a write for `idle_seconds`, and notes their objects as garbage. Returns
    /// their ids.
    pub async fn expire_uploads(&self, idle_seconds: f64) -> Result<Vec<String>, StoreError> {
        let now = self.keep_time().await?;
        transaction!(self, |tx| async {
            tx.lock(Lock::Forgetting).await?;
            uploads::expire(tx, idle_seconds, now).await
        })
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
        transaction!(self, |tx| garbage::release_upload(
            tx,
            capture,
            keep_uploads,
            now
        ))
    }

    /// Notes the `new` folders as garbage, and deletes the notes of the `gone` ones.
    pub async fn note_garbage(&self, new: &[String], gone: &[String]) -> Result<(), StoreError> {
        transaction!(self, |tx| garbage::note(tx, new, gone))
    }

    /// Forgets that these folders, and those below them, were noted as garbage.
    pub async fn forget_garbage(&self, folders: &[String]) -> Result<(), StoreError> {
        transaction!(self, |tx| garbage::forget(tx, folders))
    }

    /// Records the time, and a step of the clock since the last call, so that ages of rows count only running time.
    /// Returns the time. The health check calls it to find whether writes succeed.
    pub async fn keep_time(&self) -> Result<f64, StoreError> {
        // Held until the step is recorded, so that no other call records it again.
        let mut checks = self.checks.lock().await;
        self.db.renew().await?;
        let kept: Result<_, StoreError> = transaction!(self, |tx| async {
            let reading = Reading {
                now: tx.now(),
                steady: self.db.clock().steady(),
            };
            let (step, since) = steps::keep_time(tx, *checks, reading).await?;
            Ok((reading, step, since))
        });
        let (reading, step, since) = kept?;
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
