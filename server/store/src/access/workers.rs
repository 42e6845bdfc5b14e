//! Workers, their leases, and their reports.

use crate::rules::retention::Retention;
use crate::scripts::leases::{self, LeaseAnswer};
use crate::scripts::{metrics, outcome, outputs, queue, ranges, workers};
use crate::transaction::transaction;
use crate::{
    Ending, Entry, LeaseKey, LeaseOutcome, NewWorker, Page, Store, StoreError, TakenRange, Tenant,
};
use yoto_proto::v1::{Checkpoint, JobSpec, Progress, RenderedFile, WorkerStatus};

impl Store {
    /// Adds a worker. Returns its id.
    pub async fn register_worker(
        &self,
        tenant: &Tenant,
        new: NewWorker,
    ) -> Result<String, StoreError> {
        transaction!(self, |tx| workers::register(tx, tenant, new.clone()))
    }

    /// Checks that the tenant's worker has registered with this key: to other keys, it does not exist.
    pub async fn require_worker_of_key(
        &self,
        tenant: &Tenant,
        id: &str,
        key: &str,
    ) -> Result<(), StoreError> {
        workers::require_key(&mut self.db.read().await?, tenant, id, key).await
    }

    /// Whether a worker of the tenant finds poses in films.
    pub async fn reads_films(&self, tenant: &Tenant) -> Result<bool, StoreError> {
        workers::any_reads_films(&mut self.db.read().await?, tenant).await
    }

    /// The workers with a RUNNING job, and those that have asked for one lately. The time of a report is
    /// `lease_seconds` before the deadline of the lease.
    pub async fn active_workers(
        &self,
        tenant: &Tenant,
        lease_seconds: f64,
    ) -> Result<Vec<WorkerStatus>, StoreError> {
        workers::active(&mut self.db.read().await?, tenant, lease_seconds).await
    }

    /// All workers, newest first.
    pub async fn workers(
        &self,
        tenant: &Tenant,
        page: Page,
        lease_seconds: f64,
    ) -> Result<Vec<Entry<WorkerStatus>>, StoreError> {
        workers::list(&mut self.db.read().await?, tenant, page, lease_seconds).await
    }

    /// Leases the first queued job that the worker may run, with its inputs, or, if `help` is set, a part of a
    /// running render. A repeated `request_id` gets the same lease again while it lasts.
    pub async fn lease_job(
        &self,
        tenant: &Tenant,
        worker_id: &str,
        request_id: &str,
        help: bool,
        lease_seconds: f64,
    ) -> Result<LeaseOutcome, StoreError> {
        let ask = leases::Ask {
            tenant,
            worker_id,
            request_id,
            help,
            lease_seconds,
            requires_consent: self.requires_consent,
        };
        let prospect = queue::prospect(&mut self.db.read().await?, &ask).await?;
        if !prospect.noted {
            let noted: Result<(), StoreError> =
                transaction!(self, self.db.write_shortly(true), |tx| {
                    workers::note_request(tx, worker_id)
                });
            noted?;
        }
        if !prospect.work {
            return Ok(LeaseOutcome::default());
        }
        let mut outcome = LeaseOutcome::default();
        // One transaction for each job that is tried, so that each locks one job.
        loop {
            let answer: Result<LeaseAnswer, StoreError> =
                transaction!(self, |tx| leases::lease(tx, &ask));
            match answer? {
                LeaseAnswer::Leased(leased) => outcome.leased = Some(*leased),
                LeaseAnswer::Failed(job, reason) => {
                    outcome.failed.push((job, reason));
                    continue;
                }
                LeaseAnswer::Taken => continue,
                LeaseAnswer::Nothing => {}
            }
            return Ok(outcome);
        }
    }

    /// The order of a leased job.
    pub async fn leased_spec(
        &self,
        tenant: &Tenant,
        lease: &LeaseKey,
    ) -> Result<JobSpec, StoreError> {
        let mut tx = self.db.read().await?;
        leases::require(&mut tx, tenant, lease).await?;
        leases::spec(&mut tx, lease).await
    }

    /// Extends a lease and records progress. Returns whether the job is to be cancelled.
    pub async fn heartbeat(
        &self,
        tenant: &Tenant,
        lease: &LeaseKey,
        progress: Option<Progress>,
        lease_seconds: f64,
    ) -> Result<bool, StoreError> {
        let progress = progress.as_ref();
        let alone = !progress.is_some_and(metrics::has_figures);
        let told: Result<_, StoreError> = transaction!(self, self.db.write_shortly(alone), |tx| {
            leases::heartbeat(tx, tenant, lease, progress, lease_seconds)
        });
        match told? {
            Some(cancel) => Ok(cancel),
            None => transaction!(self, |tx| leases::helper_heartbeat(
                tx,
                tenant,
                lease,
                lease_seconds
            )),
        }
    }

    /// Puts a checkpoint of the leased train job's model into the catalogue, and removes those that the
    /// model no longer keeps. A repeated call changes nothing, even after the checkpoint was removed.
    pub async fn publish_checkpoint(
        &self,
        tenant: &Tenant,
        lease: &LeaseKey,
        checkpoint: Checkpoint,
        default: Retention,
    ) -> Result<(), StoreError> {
        transaction!(self, |tx| async {
            leases::require(tx, tenant, lease).await?;
            leases::publish(tx, lease, checkpoint.clone(), default).await
        })
    }

    /// Commits a file of the leased render or export, which replaces an earlier one of the same name.
    pub async fn commit_output(
        &self,
        tenant: &Tenant,
        lease: &LeaseKey,
        file: &RenderedFile,
    ) -> Result<(), StoreError> {
        transaction!(self, |tx| async {
            leases::require(tx, tenant, lease).await?;
            outputs::commit(tx, lease, file).await
        })
    }

    /// Assigns the next range of a render with `pictures` pictures to the lease, and marks the range that
    /// begins at `drawn` as drawn. A repeated call returns the same range.
    pub async fn take_range(
        &self,
        tenant: &Tenant,
        lease: &LeaseKey,
        pictures: u32,
        drawn: Option<u32>,
    ) -> Result<TakenRange, StoreError> {
        let taken: Result<_, StoreError> = transaction!(self, |tx| async {
            leases::require(tx, tenant, lease).await?;
            ranges::take(tx, lease, pictures, drawn).await
        });
        let (range, finished) = taken?;
        ranges::taken(&mut self.db.read().await?, &lease.job_id, range, finished).await
    }

    /// Ends a lease, and the job with it unless the lease is a helper's. In the same transaction, the capture
    /// of an ingest job becomes READY, or REJECTED if its files are at fault, or else UPLOADED, and a measured
    /// trade-off is stored with its checkpoint. A repeated call changes nothing.
    pub async fn end_job(
        &self,
        tenant: &Tenant,
        lease: &LeaseKey,
        ending: Ending,
    ) -> Result<(), StoreError> {
        transaction!(self, |tx| async {
            leases::require(tx, tenant, lease).await?;
            outcome::end(tx, tenant, lease, ending.clone()).await
        })
    }
}
