//! Reads of many rows at once: a call for each row would send as many statements as there are rows.

use std::collections::HashMap;
use tonic::Status;
use yoto_proto::v1::{Checkpoint, Consent, Job, MetricPoint, Model, ObjectRef};
use yoto_store::{CaptureFiles, JobGroup, Membership, Person, Tenant};

/// Reads of what a tenant has. Those of names and ids return what the tenant has of them, and leave out the rest: a page may
/// mention what was deleted meanwhile. Keys of objects are in what they return, and no page shows them.
#[tonic::async_trait]
pub trait Reads: Send + Sync {
    /// The names for people of models, of people, and of the people of captures, by resource.
    ///
    /// # Errors
    /// When the database fails.
    async fn names(
        &self,
        tenant: &Tenant,
        resources: &[&str],
    ) -> Result<HashMap<String, String>, Status>;

    /// Several lists of newest jobs.
    ///
    /// # Errors
    /// When the database fails.
    async fn jobs(&self, tenant: &Tenant, groups: &[JobGroup]) -> Result<Vec<Vec<Job>>, Status>;

    /// The figures of jobs over their steps, by `jobs/{id}`. Jobs without figures are left out.
    ///
    /// # Errors
    /// When the database fails.
    async fn figures(
        &self,
        tenant: &Tenant,
        jobs: &[&str],
    ) -> Result<HashMap<String, Vec<MetricPoint>>, Status>;

    /// People with the captures by which pages show them, by `subjects/{id}`.
    ///
    /// # Errors
    /// When the database fails.
    async fn people(
        &self,
        tenant: &Tenant,
        subjects: &[&str],
    ) -> Result<HashMap<String, Person>, Status>;

    /// The consents of people, newest first.
    ///
    /// # Errors
    /// When the database fails.
    async fn consents(&self, tenant: &Tenant, subjects: &[&str]) -> Result<Vec<Consent>, Status>;

    /// The captures of a person, oldest first.
    ///
    /// # Errors
    /// When the person does not exist, or the database fails.
    async fn captures(&self, tenant: &Tenant, subject: &str) -> Result<Vec<CaptureFiles>, Status>;

    /// All models, oldest first, and whether the person is in each.
    ///
    /// # Errors
    /// When `subject` is no name, or the database fails.
    async fn memberships(&self, tenant: &Tenant, subject: &str) -> Result<Vec<Membership>, Status>;

    /// The models of these names, in their order.
    ///
    /// # Errors
    /// Those of `GetModel` for one of them.
    async fn models(&self, tenant: &Tenant, names: &[&str]) -> Result<Vec<Model>, Status>;

    /// The checkpoints of a model as `ListCheckpoints` has them, with their manifests.
    ///
    /// # Errors
    /// Those of `ListCheckpoints`.
    async fn checkpoints(&self, tenant: &Tenant, model: &str) -> Result<Vec<Checkpoint>, Status>;

    /// The best checkpoint of each of these models, by `models/{id}`. It does not tell why it is kept.
    ///
    /// # Errors
    /// When the database fails.
    async fn best_checkpoints(
        &self,
        tenant: &Tenant,
        models: &[&str],
    ) -> Result<HashMap<String, Checkpoint>, Status>;

    /// The bytes of an object that another read has returned; `None` if there are more than `most`.
    ///
    /// # Errors
    /// When the object is missing, or the store can't be read.
    async fn object(&self, object: &ObjectRef, most: usize) -> Result<Option<Vec<u8>>, Status>;

    /// The object of a file of a checkpoint that has a manifest; `None` if it has no such file.
    ///
    /// # Errors
    /// When the manifest is damaged, or the store can't be read.
    async fn file_of(
        &self,
        checkpoint: &Checkpoint,
        file: &str,
    ) -> Result<Option<ObjectRef>, Status>;
}
