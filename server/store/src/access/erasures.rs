//! Removals of people, step by step.

use crate::scripts::{audit, erasures, leaving, removal, retraining, traces};
use crate::transaction::transaction;
use crate::{
    Entry, Leaving, OpenErasure, Page, SignedReport, Store, StoreError, Tenant, Trace, Work,
};
use yoto_proto::v1::Erasure;

impl Store {
    /// Begins to remove a person, or tries again after a failure.
    pub async fn begin_erasure(
        &self,
        tenant: &Tenant,
        subject_id: &str,
        retrain: bool,
    ) -> Result<Erasure, StoreError> {
        transaction!(self, |tx| erasures::begin(tx, tenant, subject_id, retrain))
    }

    /// The erasure of a person, if it was ever begun.
    pub async fn erasure_of(
        &self,
        tenant: &Tenant,
        subject_id: &str,
    ) -> Result<Option<Erasure>, StoreError> {
        erasures::of_subject(&mut self.db.read().await?, tenant, subject_id).await
    }

    /// An erasure by id.
    pub async fn erasure(&self, tenant: &Tenant, id: &str) -> Result<Erasure, StoreError> {
        erasures::get(&mut self.db.read().await?, tenant, id).await
    }

    /// Erasures, newest first.
    pub async fn erasures(
        &self,
        tenant: &Tenant,
        page: Page,
    ) -> Result<Vec<Entry<Erasure>>, StoreError> {
        erasures::list(&mut self.db.read().await?, tenant, page).await
    }

    /// All erasures of all tenants, the oldest first.
    pub async fn all_erasures(&self) -> Result<Vec<Erasure>, StoreError> {
        erasures::all(&mut self.db.read().await?).await
    }

    /// Begins to remove a person of any tenant who was erased before this database was restored. Returns whether they are here.
    pub async fn erase_again(&self, subject_id: &str) -> Result<bool, StoreError> {
        transaction!(self, |tx| erasures::again(tx, subject_id))
    }

    /// Those that go on, of all tenants.
    pub async fn open_erasures(&self) -> Result<Vec<OpenErasure>, StoreError> {
        erasures::open(&mut self.db.read().await?).await
    }

    /// Ends the open ingest jobs of a person. Returns their ids.
    pub async fn stop_ingests(&self, subject_id: &str) -> Result<Vec<String>, StoreError> {
        let jobs = leaving::ingests(&mut self.db.read().await?, subject_id).await?;
        for job in &jobs {
            let done: Result<(), StoreError> =
                transaction!(self, |tx| leaving::stop_ingest(tx, job));
            done?;
        }
        Ok(jobs)
    }

    /// How far each model of the person is, by its id: a job that takes them out is queued where it is needed.
    pub async fn leave_models(
        &self,
        erasure: &OpenErasure,
    ) -> Result<Vec<(String, Leaving)>, StoreError> {
        let models = leaving::models_of(&mut self.db.read().await?, &erasure.subject_id).await?;
        let mut found = Vec::with_capacity(models.len());
        for model in models {
            let leaving: Result<_, StoreError> =
                transaction!(self, |tx| leaving::leave(tx, erasure, &model));
            found.push((model, leaving?));
        }
        Ok(found)
    }

    /// Queues trainings from scratch of the others, in a new model in place of each whose shared parameters have seen the person. Returns
    /// the ids of the new models; a second call finds them again.
    pub async fn retrain(&self, erasure: &OpenErasure) -> Result<Vec<String>, StoreError> {
        let models = leaving::models_of(&mut self.db.read().await?, &erasure.subject_id).await?;
        let mut made = Vec::new();
        for old in &models {
            let new: Result<Option<String>, StoreError> =
                transaction!(self, |tx| retraining::model(tx, erasure, old));
            if let Some(new) = new? {
                let queued: Result<(), StoreError> =
                    transaction!(self, |tx| retraining::job(tx, &erasure.tenant, old, &new));
                queued?;
                made.push(new);
            }
        }
        Ok(made)
    }

    /// Removes the rows of the person, unless an open job still needs them.
    pub async fn erase_rows(&self, erasure: &OpenErasure) -> Result<Option<Work>, StoreError> {
        transaction!(self, |tx| removal::rows(tx, erasure))
    }

    /// Tells what an erasure waits for.
    pub async fn note_erasure(&self, id: &str, message: &str) -> Result<(), StoreError> {
        transaction!(self, |tx| erasures::wait(tx, id, message))
    }

    /// Notes what is still to be done once the rows are gone.
    pub async fn note_work(&self, id: &str, work: &str) -> Result<(), StoreError> {
        transaction!(self, |tx| erasures::note_work(tx, id, work))
    }

    /// Ends an erasure that can't go on.
    pub async fn fail_erasure(&self, id: &str, message: &str) -> Result<(), StoreError> {
        transaction!(self, |tx| erasures::fail(tx, id, message))
    }

    /// Ends an erasure with its report.
    pub async fn end_erasure(&self, id: &str, report: &SignedReport) -> Result<(), StoreError> {
        transaction!(self, |tx| erasures::done(tx, id, report))
    }

    /// The columns of all tables, but those of erasures, whose rows have one of these ids, of all tenants.
    pub async fn traces_of_ids(&self, ids: &[String]) -> Result<Vec<Trace>, StoreError> {
        // Calls that ended since the rows were removed.
        transaction!(self, |tx| audit::forget(tx, ids))?;
        traces::of_ids(&mut self.db.read().await?, ids).await
    }

    /// The same for a name, in columns of texts and of encoded messages.
    pub async fn traces_of_name(&self, name: &str) -> Result<Vec<Trace>, StoreError> {
        traces::of_name(&mut self.db.read().await?, name).await
    }
}
