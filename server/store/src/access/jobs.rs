//! Jobs for their owners, and answers to repeated requests.

use crate::scripts::{
    ended, jobs, metrics, outputs, pauses, requests, service_state, versions, workers,
};
use crate::transaction::transaction;
use crate::{
    EndedJob, Entry, JobFilter, JobKind, JobVersions, NewJob, OperatorNote, Page, QueueFigures,
    RequestKey, ServiceState, Store, StoreError, Tenant,
};
use yoto_proto::v1::{Job, JobMetrics, PausedKind, RenderedFile};

impl Store {
    /// The stored answer to `request`, in most cases an id.
    pub async fn answered(
        &self,
        tenant: &Tenant,
        request: Option<&RequestKey>,
    ) -> Result<Option<String>, StoreError> {
        requests::answered(&mut self.db.read().await?, tenant, request).await
    }

    /// Queues a job, or repeats the earlier answer to `request`.
    pub async fn create_job(
        &self,
        tenant: &Tenant,
        new: NewJob,
        request: Option<RequestKey>,
    ) -> Result<Job, StoreError> {
        transaction!(self, |tx| jobs::create(
            tx,
            tenant,
            new.clone(),
            request.clone(),
            self.requires_consent
        ))
    }

    /// A job by id.
    pub async fn job(&self, tenant: &Tenant, id: &str) -> Result<Job, StoreError> {
        jobs::get(&mut self.db.read().await?, tenant, id).await
    }

    /// A job by id, without its order, which may be long and never changes.
    pub async fn job_state(&self, tenant: &Tenant, id: &str) -> Result<Job, StoreError> {
        jobs::without_order(&mut self.db.read().await?, tenant, id).await
    }

    /// A job by id, with its attempts.
    pub async fn job_history(&self, tenant: &Tenant, id: &str) -> Result<Job, StoreError> {
        jobs::with_attempts(&mut self.db.read().await?, tenant, id).await
    }

    /// Jobs that match the filter, newest first; with their orders if `full`.
    pub async fn jobs(
        &self,
        tenant: &Tenant,
        page: Page,
        filter: &JobFilter,
        full: bool,
    ) -> Result<Vec<Entry<Job>>, StoreError> {
        jobs::list(&mut self.db.read().await?, tenant, page, filter, full).await
    }

    /// The figures of a job over its steps.
    pub async fn job_metrics(&self, tenant: &Tenant, id: &str) -> Result<JobMetrics, StoreError> {
        metrics::of_job(&mut self.db.read().await?, tenant, id).await
    }

    /// The tenant's open jobs, and its newest ones of whatever state: all after the position `after`, and some before it, since
    /// jobs are not committed in the order of their positions. With the position of the newest one.
    pub async fn job_versions(
        &self,
        tenant: &Tenant,
        after: Option<i64>,
    ) -> Result<JobVersions, StoreError> {
        versions::list(&mut self.db.read().await?, tenant, after).await
    }

    /// The files that a render has committed so far.
    pub async fn outputs(
        &self,
        tenant: &Tenant,
        job_id: &str,
    ) -> Result<Vec<RenderedFile>, StoreError> {
        let mut tx = self.db.read().await?;
        jobs::require(&mut tx, tenant, job_id).await?;
        outputs::list(&mut tx, job_id).await
    }

    /// The state of the tenant's queue: how many jobs wait and run, and what keeps workers from taking them.
    pub async fn service_state(&self, tenant: &Tenant) -> Result<ServiceState, StoreError> {
        service_state::read(&mut self.db.read().await?, tenant).await
    }

    /// The open jobs and the workers of all tenants.
    pub async fn queue_figures(&self) -> Result<QueueFigures, StoreError> {
        let mut tx = self.db.read().await?;
        Ok(QueueFigures {
            open: jobs::figures(&mut tx).await?,
            workers: workers::count(&mut tx).await?,
        })
    }

    /// Those of the jobs `ids` that have ended, of all tenants.
    pub async fn ended_jobs(&self, ids: &[&str]) -> Result<Vec<EndedJob>, StoreError> {
        ended::list(&mut self.db.read().await?, ids).await
    }

    /// Ends a QUEUED job and marks a RUNNING one for cancellation; an ended job is not changed. A repeated call
    /// changes nothing.
    pub async fn cancel_job(
        &self,
        tenant: &Tenant,
        id: &str,
        request: Option<RequestKey>,
    ) -> Result<Job, StoreError> {
        transaction!(self, |tx| jobs::cancel(tx, tenant, id, request.clone()))
    }

    /// Stops leasing jobs of a kind, for a reason.
    pub async fn pause_jobs(
        &self,
        tenant: &Tenant,
        kind: JobKind,
        note: OperatorNote<'_>,
    ) -> Result<(), StoreError> {
        transaction!(self, |tx| pauses::pause(tx, tenant, kind, note))
    }

    /// Leases jobs of a kind again.
    pub async fn resume_jobs(&self, tenant: &Tenant, kind: JobKind) -> Result<(), StoreError> {
        transaction!(self, |tx| pauses::resume(tx, tenant, kind))
    }

    /// Kinds of jobs that are not leased.
    pub async fn paused_kinds(&self, tenant: &Tenant) -> Result<Vec<PausedKind>, StoreError> {
        pauses::list(&mut self.db.read().await?, tenant).await
    }
}
