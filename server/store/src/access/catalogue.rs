//! The catalogue: people, captures, models, checkpoints, and their deletion.

use crate::rules::retention::Retention;
use crate::scripts::{aliases, capture_objects, captures, checkpoints, deletion, models, subjects};
use crate::transaction::transaction;
use crate::{
    Entry, NewModel, NewSubject, Page, RequestKey, Store, StoreError, SubjectChange, Target, Tenant,
};
use yoto_proto::v1::{
    self, Capture, Checkpoint, Deleted, IdentitySlot, Model, RenderedFile, Subject,
};
use yoto_proto::worker::v1::SubjectShard;

impl Store {
    /// Creates a subject, or repeats the earlier answer to `request`.
    pub async fn create_subject(
        &self,
        tenant: &Tenant,
        new: NewSubject,
        request: Option<RequestKey>,
    ) -> Result<Subject, StoreError> {
        transaction!(self, |tx| subjects::create(
            tx,
            tenant,
            new.clone(),
            request.clone()
        ))
    }

    /// A subject by id.
    pub async fn subject(&self, tenant: &Tenant, id: &str) -> Result<Subject, StoreError> {
        subjects::get(&mut self.db.read().await?, tenant, id).await
    }

    /// Subjects, oldest first.
    pub async fn subjects(
        &self,
        tenant: &Tenant,
        page: Page,
    ) -> Result<Vec<Entry<Subject>>, StoreError> {
        subjects::list(&mut self.db.read().await?, tenant, page).await
    }

    /// Changes a subject, if its version is `etag` (empty: any).
    pub async fn update_subject(
        &self,
        tenant: &Tenant,
        id: &str,
        change: SubjectChange,
        etag: &str,
    ) -> Result<Subject, StoreError> {
        transaction!(self, |tx| subjects::update(
            tx,
            tenant,
            id,
            change.clone(),
            etag
        ))
    }

    /// The shard of the subject's newest READY capture.
    pub async fn shard(
        &self,
        tenant: &Tenant,
        subject_id: &str,
    ) -> Result<Option<SubjectShard>, StoreError> {
        subjects::shard(&mut self.db.read().await?, tenant, subject_id).await
    }

    /// A capture by id.
    pub async fn capture(&self, tenant: &Tenant, id: &str) -> Result<Capture, StoreError> {
        captures::get(&mut self.db.read().await?, tenant, id).await
    }

    /// Captures of a person, who must exist, or of all people, oldest first.
    pub async fn captures(
        &self,
        tenant: &Tenant,
        page: Page,
        subject_id: Option<&str>,
    ) -> Result<Vec<Entry<Capture>>, StoreError> {
        let found = captures::list(&mut self.db.read().await?, tenant, page, subject_id).await?;
        let entries = found.into_iter().map(|it| Entry {
            position: it.position,
            item: it.item.capture,
        });
        Ok(entries.collect())
    }

    /// What the ingest job of a capture made: its frames, the check's report and a thumbnail.
    pub async fn capture_objects(
        &self,
        tenant: &Tenant,
        id: &str,
    ) -> Result<Vec<RenderedFile>, StoreError> {
        let mut tx = self.db.read().await?;
        captures::get(&mut tx, tenant, id).await?;
        capture_objects::list(&mut tx, id).await
    }

    /// Creates a model, or repeats the earlier answer to `request`.
    pub async fn create_model(
        &self,
        tenant: &Tenant,
        new: NewModel,
        request: Option<RequestKey>,
    ) -> Result<Model, StoreError> {
        transaction!(self, |tx| models::create(
            tx,
            tenant,
            new.clone(),
            request.clone()
        ))
    }

    /// A model by id, with its slots.
    pub async fn model(&self, tenant: &Tenant, id: &str) -> Result<Model, StoreError> {
        models::get(&mut self.db.read().await?, tenant, id).await
    }

    /// Checks that the tenant has the model.
    pub async fn require_model(&self, tenant: &Tenant, id: &str) -> Result<(), StoreError> {
        models::require(&mut self.db.read().await?, tenant, id).await
    }

    /// Models, oldest first.
    pub async fn models(
        &self,
        tenant: &Tenant,
        page: Page,
    ) -> Result<Vec<Entry<Model>>, StoreError> {
        models::list(&mut self.db.read().await?, tenant, page).await
    }

    /// Gives a READY subject the next slot, or returns its existing slot.
    pub async fn add_identity(
        &self,
        tenant: &Tenant,
        model_id: &str,
        subject_id: &str,
        request: Option<RequestKey>,
    ) -> Result<IdentitySlot, StoreError> {
        transaction!(self, |tx| models::add_identity(
            tx,
            tenant,
            model_id,
            subject_id,
            request.clone()
        ))
    }

    /// Removes a subject's slot that no checkpoint was trained with.
    pub async fn remove_identity(
        &self,
        tenant: &Tenant,
        model_id: &str,
        subject_id: &str,
        request: Option<RequestKey>,
    ) -> Result<Model, StoreError> {
        transaction!(self, |tx| models::remove_identity(
            tx,
            tenant,
            model_id,
            subject_id,
            request.clone()
        ))
    }

    /// Checkpoints of a model, newest first, at most `limit`.
    pub async fn checkpoints(
        &self,
        tenant: &Tenant,
        model_id: &str,
        limit: u32,
    ) -> Result<Vec<Checkpoint>, StoreError> {
        checkpoints::list(&mut self.db.read().await?, tenant, model_id, limit).await
    }

    /// Gives a checkpoint of the tenant's model an alias.
    pub async fn set_alias(
        &self,
        tenant: &Tenant,
        model_id: &str,
        step: u64,
        alias: &str,
    ) -> Result<(), StoreError> {
        transaction!(self, |tx| aliases::set(tx, tenant, model_id, step, alias))
    }

    /// Takes an alias away. Returns whether a checkpoint of the model had it.
    pub async fn remove_alias(
        &self,
        tenant: &Tenant,
        model_id: &str,
        alias: &str,
    ) -> Result<bool, StoreError> {
        transaction!(self, |tx| aliases::remove(tx, tenant, model_id, alias))
    }

    /// The step of the checkpoint with the alias, if the tenant's model has one.
    pub async fn step_of_alias(
        &self,
        tenant: &Tenant,
        model_id: &str,
        alias: &str,
    ) -> Result<Option<u64>, StoreError> {
        aliases::step(&mut self.db.read().await?, tenant, model_id, alias).await
    }

    /// All checkpoints of a model, newest first, with the reasons to keep each.
    pub async fn kept_checkpoints(
        &self,
        tenant: &Tenant,
        model_id: &str,
        default: Retention,
    ) -> Result<Vec<Checkpoint>, StoreError> {
        checkpoints::explained(&mut self.db.read().await?, tenant, model_id, default).await
    }

    /// Changes which checkpoints a model keeps, if its version is `etag` (empty: any), and removes the others in the same
    /// transaction.
    pub async fn set_retention(
        &self,
        tenant: &Tenant,
        model_id: &str,
        retention: v1::Retention,
        default: Retention,
        etag: &str,
    ) -> Result<Model, StoreError> {
        transaction!(self, |tx| models::set_retention(
            tx, tenant, model_id, &retention, default, etag
        ))
    }

    /// Deletes the rows of a resource that no open job uses, and notes its objects as garbage, in one
    /// transaction. A repeated `request` gets its first answer.
    pub async fn delete(
        &self,
        tenant: &Tenant,
        target: Target<'_>,
        etag: &str,
        request: Option<RequestKey>,
    ) -> Result<Deleted, StoreError> {
        transaction!(self, |tx| deletion::delete(
            tx,
            tenant,
            target,
            etag,
            request.clone()
        ))
    }
}
