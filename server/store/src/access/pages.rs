//! Reads of many rows at once, for pages.

use crate::scripts::{captures, checkpoints, consents, metrics, models, pages};
use crate::{CaptureFiles, JobGroup, Membership, Page, Person, Store, StoreError, Tenant};
use std::collections::HashMap;
use yoto_proto::v1::{Checkpoint, Consent, Job, MetricPoint, Model};

impl Store {
    /// The names for people of those of `resources` that the tenant has: models, people, and captures, which have the names of
    /// their people.
    pub async fn names(
        &self,
        tenant: &Tenant,
        resources: &[&str],
    ) -> Result<HashMap<String, String>, StoreError> {
        if resources.is_empty() {
            return Ok(HashMap::new());
        }
        pages::names::of(&mut self.db.read().await?, tenant, resources).await
    }

    /// Several lists of the tenant's newest jobs.
    pub async fn job_groups(
        &self,
        tenant: &Tenant,
        groups: &[JobGroup],
    ) -> Result<Vec<Vec<Job>>, StoreError> {
        pages::jobs::groups(&mut self.db.read().await?, tenant, groups).await
    }

    /// The tenant's people among those with these ids, oldest first, with the captures by which pages show them.
    pub async fn people(&self, tenant: &Tenant, ids: &[&str]) -> Result<Vec<Person>, StoreError> {
        pages::people::of(&mut self.db.read().await?, tenant, ids).await
    }

    /// The tenant's models among those with these ids, oldest first.
    pub async fn models_of(&self, tenant: &Tenant, ids: &[&str]) -> Result<Vec<Model>, StoreError> {
        models::some(&mut self.db.read().await?, tenant, ids).await
    }

    /// All models of the tenant, oldest first, and whether the person is in each.
    pub async fn memberships(
        &self,
        tenant: &Tenant,
        subject_id: &str,
    ) -> Result<Vec<Membership>, StoreError> {
        pages::models::with_person(&mut self.db.read().await?, tenant, subject_id).await
    }

    /// The captures of a person, who must exist, oldest first, with their files.
    pub async fn captures_with_files(
        &self,
        tenant: &Tenant,
        subject_id: &str,
        most: u32,
    ) -> Result<Vec<CaptureFiles>, StoreError> {
        let page = Page {
            limit: most,
            after: None,
        };
        let mut tx = self.db.read().await?;
        let found = captures::list(&mut tx, tenant, page, Some(subject_id)).await?;
        Ok(found.into_iter().map(|it| it.item).collect())
    }

    /// The figures over their steps of those of these jobs that the tenant has and that have figures, by id.
    pub async fn figures_of(
        &self,
        tenant: &Tenant,
        jobs: &[&str],
    ) -> Result<HashMap<String, Vec<MetricPoint>>, StoreError> {
        if jobs.is_empty() {
            return Ok(HashMap::new());
        }
        metrics::of_jobs(&mut self.db.read().await?, tenant, jobs).await
    }

    /// The checkpoints of those of these models that the tenant has, newest first, by the models' ids.
    pub async fn checkpoints_of(
        &self,
        tenant: &Tenant,
        models: &[&str],
    ) -> Result<HashMap<String, Vec<Checkpoint>>, StoreError> {
        checkpoints::of_models(&mut self.db.read().await?, tenant, models).await
    }

    /// The consents of those of these people whom the tenant has, newest first.
    pub async fn consents_of(
        &self,
        tenant: &Tenant,
        subjects: &[&str],
    ) -> Result<Vec<Consent>, StoreError> {
        consents::of_people(&mut self.db.read().await?, tenant, subjects).await
    }
}
