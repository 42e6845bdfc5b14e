//! Reads of many rows at once for pages, from the store and the objects.

use super::backend::Coordinated;
use crate::api::{explained, fields};
use crate::objects::manifest;
use futures::TryStreamExt;
use std::collections::HashMap;
use tonic::Status;
use yoto_dashboard::Reads;
use yoto_proto::limits::LONGEST_PAGE_ENTRIES;
use yoto_proto::names::Collection;
use yoto_proto::v1::{Checkpoint, Consent, ErrorReason, Job, MetricPoint, Model, ObjectRef};
use yoto_request::RequestError;
use yoto_store::rules::best::best_first;
use yoto_store::{CaptureFiles, JobGroup, Membership, Person, Tenant};

/// The ids in those of `names` that are of the collection.
fn ids<'n>(collection: Collection, names: &[&'n str]) -> Vec<&'n str> {
    let ids = names.iter().filter_map(|it| collection.parse(it).ok());
    ids.collect()
}

/// The map with the names of resources in place of their ids.
fn by_name<T>(collection: Collection, by_id: HashMap<String, T>) -> HashMap<String, T> {
    let named = by_id.into_iter();
    named.map(|(id, it)| (collection.name(&id), it)).collect()
}

#[tonic::async_trait]
impl Reads for Coordinated {
    async fn names(
        &self,
        tenant: &Tenant,
        resources: &[&str],
    ) -> Result<HashMap<String, String>, Status> {
        let names = self.0.store.names(tenant, resources).await;
        Ok(names.map_err(RequestError::from)?)
    }

    async fn jobs(&self, tenant: &Tenant, groups: &[JobGroup]) -> Result<Vec<Vec<Job>>, Status> {
        let lists = self.0.store.job_groups(tenant, groups).await;
        Ok(lists.map_err(RequestError::from)?)
    }

    async fn figures(
        &self,
        tenant: &Tenant,
        jobs: &[&str],
    ) -> Result<HashMap<String, Vec<MetricPoint>>, Status> {
        let jobs = ids(Collection::Jobs, jobs);
        let figures = self.0.store.figures_of(tenant, &jobs).await;
        Ok(by_name(
            Collection::Jobs,
            figures.map_err(RequestError::from)?,
        ))
    }

    async fn people(
        &self,
        tenant: &Tenant,
        subjects: &[&str],
    ) -> Result<HashMap<String, Person>, Status> {
        let subjects = ids(Collection::Subjects, subjects);
        let people = self.0.store.people(tenant, &subjects).await;
        let people = people.map_err(RequestError::from)?.into_iter();
        Ok(people.map(|it| (it.subject.name.clone(), it)).collect())
    }

    async fn consents(&self, tenant: &Tenant, subjects: &[&str]) -> Result<Vec<Consent>, Status> {
        let subjects = ids(Collection::Subjects, subjects);
        let consents = self.0.store.consents_of(tenant, &subjects).await;
        Ok(consents.map_err(RequestError::from)?)
    }

    async fn captures(&self, tenant: &Tenant, subject: &str) -> Result<Vec<CaptureFiles>, Status> {
        let id = fields::id(Collection::Subjects, "parent", subject)?;
        let store = &self.0.store;
        let captures = store.captures_with_files(tenant, &id, LONGEST_PAGE_ENTRIES);
        Ok(captures.await.map_err(RequestError::from)?)
    }

    async fn memberships(&self, tenant: &Tenant, subject: &str) -> Result<Vec<Membership>, Status> {
        let id = fields::id(Collection::Subjects, "name", subject)?;
        let models = self.0.store.memberships(tenant, &id).await;
        Ok(models.map_err(RequestError::from)?)
    }

    async fn models(&self, tenant: &Tenant, names: &[&str]) -> Result<Vec<Model>, Status> {
        let ids = names
            .iter()
            .map(|it| fields::id(Collection::Models, "name", it));
        let ids = ids.collect::<Result<Vec<_>, RequestError>>()?;
        let ids: Vec<&str> = ids.iter().map(String::as_str).collect();
        let found = self.0.store.models_of(tenant, &ids).await;
        let found = found.map_err(RequestError::from)?;
        let of_name = |name: &&str| {
            let model = found.iter().find(|it| it.name == *name).cloned();
            model.ok_or_else(|| {
                let name = (*name).to_owned();
                Status::from(RequestError::NotFound { name })
            })
        };
        names.iter().map(of_name).collect()
    }

    async fn checkpoints(&self, tenant: &Tenant, model: &str) -> Result<Vec<Checkpoint>, Status> {
        let id = fields::id(Collection::Models, "model", model)?;
        Ok(explained(&self.0, tenant, &id).await?)
    }

    async fn best_checkpoints(
        &self,
        tenant: &Tenant,
        models: &[&str],
    ) -> Result<HashMap<String, Checkpoint>, Status> {
        let ids = ids(Collection::Models, models);
        let checkpoints = self.0.store.checkpoints_of(tenant, &ids).await;
        let checkpoints = checkpoints.map_err(RequestError::from)?.into_iter();
        let best =
            checkpoints.filter_map(|(id, all)| Some((id, best_first(all).into_iter().next()?)));
        Ok(by_name(Collection::Models, best.collect()))
    }

    async fn object(&self, object: &ObjectRef, most: usize) -> Result<Option<Vec<u8>>, Status> {
        if object.bytes > most as u64 {
            return Ok(None);
        }
        if object.bytes == 0 {
            return Ok(Some(Vec::new()));
        }
        let chunks = self.0.objects.stream(object, Some(0..object.bytes)).await;
        let chunks = chunks.map_err(RequestError::from)?;
        let bytes = chunks.try_fold(Vec::new(), |mut bytes, chunk| async move {
            bytes.extend_from_slice(&chunk);
            Ok(bytes)
        });
        Ok(Some(bytes.await.map_err(RequestError::from)?))
    }

    async fn file_of(
        &self,
        checkpoint: &Checkpoint,
        file: &str,
    ) -> Result<Option<ObjectRef>, Status> {
        let object = checkpoint.manifest.as_ref().ok_or_else(|| {
            let message = format!("{} has no manifest", checkpoint.name);
            RequestError::precondition(ErrorReason::CheckpointTorn, message)
        })?;
        let manifest = manifest::read(&self.0, object).await?;
        Ok(manifest.object(file).map(|it| ObjectRef {
            key: it.key.clone(),
            bytes: it.bytes,
            sha256: it.sha256.clone(),
        }))
    }
}
