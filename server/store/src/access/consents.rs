//! What people have agreed to, and the jobs that end without it.

use crate::scripts::{consent_rule, consents};
use crate::transaction::transaction;
use crate::{
    Entry, NewConsent, NewEvidence, Page, RequestKey, StoppedJob, Store, StoreError, Tenant,
};
use yoto_proto::names::Collection;
use yoto_proto::v1::{Consent, ConsentPurpose, JobSpec};

impl Store {
    /// Records a consent, or repeats the earlier answer to `request`.
    pub async fn grant_consent(
        &self,
        tenant: &Tenant,
        subject_id: &str,
        new: &NewConsent,
        request: Option<RequestKey>,
    ) -> Result<Consent, StoreError> {
        transaction!(self, |tx| consents::grant(
            tx,
            tenant,
            subject_id,
            new,
            request.clone()
        ))
    }

    /// Revokes all consents of a person to these purposes. Jobs end with [`Store::stop_without_consent`].
    pub async fn revoke_consent(
        &self,
        tenant: &Tenant,
        subject_id: &str,
        purposes: &[ConsentPurpose],
        note: &str,
        request: Option<RequestKey>,
    ) -> Result<(), StoreError> {
        transaction!(self, |tx| consents::revoke(
            tx,
            tenant,
            subject_id,
            purposes,
            note,
            request.clone()
        ))
    }

    /// The consents of a person, newest first.
    pub async fn consents(
        &self,
        tenant: &Tenant,
        subject_id: &str,
        page: Page,
    ) -> Result<Vec<Entry<Consent>>, StoreError> {
        consents::list(&mut self.db.read().await?, tenant, subject_id, page).await
    }

    /// The file that proves a consent of the tenant.
    pub async fn consent_evidence(
        &self,
        tenant: &Tenant,
        id: &str,
    ) -> Result<NewEvidence, StoreError> {
        consents::file(&mut self.db.read().await?, tenant, id).await
    }

    /// Refuses the order of a job, whose names were checked, if a person in it lacks consent.
    pub async fn check_consent(&self, tenant: &Tenant, spec: &JobSpec) -> Result<(), StoreError> {
        let mut tx = self.db.read().await?;
        consent_rule::check(&mut tx, tenant, spec, self.requires_consent).await
    }

    /// Ends the open jobs that need this person, or anybody of all tenants, and whose consent was revoked or has run out.
    pub async fn stop_without_consent(
        &self,
        subject_id: Option<&str>,
    ) -> Result<Vec<StoppedJob>, StoreError> {
        let found = consent_rule::to_stop(&mut self.db.read().await?, subject_id).await?;
        let mut stopped = Vec::new();
        // One transaction for each, so that each locks one job.
        for id in found {
            let reason: Result<_, StoreError> =
                transaction!(self, |tx| consent_rule::stop(tx, &id));
            if let Some(reason) = reason? {
                let job = Collection::Jobs.name(&id);
                stopped.push(StoppedJob { job, reason });
            }
        }
        Ok(stopped)
    }
}
