//! What people have agreed to.

use super::retry::{read, repeat};
use super::{ClientError, YotoClient, request_id};
use prost_types::Timestamp;
use yoto_proto::limits::LONGEST_PAGE_ENTRIES;
use yoto_proto::v1::{
    Consent, ConsentEvidence, ConsentPurpose, GetConsentEvidenceRequest, GrantConsentRequest,
    ListConsentsRequest, RevokeConsentRequest,
};

/// A consent to record.
#[derive(Debug, Clone, Default)]
pub struct NewConsent {
    /// What the person agrees to, at least one.
    pub purposes: Vec<ConsentPurpose>,
    /// Who gave the consent; empty: the person.
    pub given_by: String,
    /// Anything else.
    pub note: String,
    /// When it runs out; none: never.
    pub expire_time: Option<Timestamp>,
    /// Name and content of a file that proves it.
    pub evidence: Option<(String, Vec<u8>)>,
}

fn numbers(purposes: &[ConsentPurpose]) -> Vec<i32> {
    purposes.iter().map(|it| (*it).into()).collect()
}

impl YotoClient {
    /// Records a consent of the person `subject`.
    ///
    /// # Errors
    /// [`ClientError::Refused`], e.g. when there is no such person.
    pub async fn grant_consent(
        &self,
        subject: &str,
        new: NewConsent,
    ) -> Result<Consent, ClientError> {
        let (evidence_file_name, evidence) = new.evidence.unwrap_or_default();
        let request = GrantConsentRequest {
            evidence,
            evidence_file_name,
            subject: subject.to_owned(),
            purposes: numbers(&new.purposes),
            given_by: new.given_by,
            note: new.note,
            expire_time: new.expire_time,
            request_id: request_id(),
        };
        let grant = || {
            let (mut service, request) = (self.subject_service(), request.clone());
            async move { service.grant_consent(request).await }
        };
        let doing = format!("recording a consent of {subject}");
        repeat(grant).await.map_err(ClientError::refused(doing))
    }

    /// The file that proves the consent `name`, "consents/{id}".
    ///
    /// # Errors
    /// [`ClientError::Refused`], e.g. when there is none.
    pub async fn consent_evidence(&self, name: &str) -> Result<ConsentEvidence, ClientError> {
        let get = || {
            let mut service = self.subject_service();
            let name = name.to_owned();
            async move {
                service
                    .get_consent_evidence(GetConsentEvidenceRequest { name })
                    .await
            }
        };
        let doing = format!("reading the evidence of {name}");
        read(get).await.map_err(ClientError::refused(doing))
    }

    /// Revokes all consents of the person `subject` to these purposes, or to all if there are none. Returns the jobs that ended
    /// because of it; after a lost answer, none.
    ///
    /// # Errors
    /// [`ClientError::Refused`], e.g. when there is no such person.
    pub async fn revoke_consent(
        &self,
        subject: &str,
        purposes: &[ConsentPurpose],
        note: &str,
    ) -> Result<Vec<String>, ClientError> {
        let request = RevokeConsentRequest {
            subject: subject.to_owned(),
            purposes: numbers(purposes),
            note: note.to_owned(),
            request_id: request_id(),
        };
        let revoke = || {
            let (mut service, request) = (self.subject_service(), request.clone());
            async move { service.revoke_consent(request).await }
        };
        let doing = format!("revoking the consent of {subject}");
        let revoked = repeat(revoke).await.map_err(ClientError::refused(doing))?;
        Ok(revoked.jobs)
    }

    /// The consents of the person `subject`, newest first, over all pages.
    ///
    /// # Errors
    /// [`ClientError::Refused`] when there is no such person.
    pub async fn list_consents(&self, subject: &str) -> Result<Vec<Consent>, ClientError> {
        let (mut consents, mut page_token) = (Vec::new(), String::new());
        loop {
            let request = ListConsentsRequest {
                parent: subject.to_owned(),
                page_size: LONGEST_PAGE_ENTRIES as i32,
                page_token,
            };
            let list = || {
                let (mut service, request) = (self.subject_service(), request.clone());
                async move { service.list_consents(request).await }
            };
            let page = read(list).await;
            let page = page.map_err(ClientError::refused("listing consents"))?;
            consents.extend(page.consents);
            page_token = page.next_page_token;
            if page_token.is_empty() {
                return Ok(consents);
            }
        }
    }
}
