//! The calls of `yoto.v1.SubjectService` about consent.

use super::{fields, paging};
use crate::context::Context;
use crate::jobs::consent;
use yoto_proto::limits::{
    CONSENT_NOTE_BYTES, EVIDENCE_BYTES, EVIDENCE_NAME_BYTES, OWNER_CHARACTERS,
};
use yoto_proto::names::Collection;
use yoto_proto::sha256_hex;
use yoto_proto::v1::{
    Consent, ConsentEvidence, ConsentPurpose, Evidence, GetConsentEvidenceRequest,
    GrantConsentRequest, ListConsentsRequest, ListConsentsResponse, RevokeConsentRequest,
    RevokeConsentResponse,
};
use yoto_request::RequestError;
use yoto_request::validation::{all, both};
use yoto_store::{NewConsent, NewEvidence, Tenant};

/// All purposes.
const PURPOSES: [ConsentPurpose; 4] = [
    ConsentPurpose::ConsentTrain,
    ConsentPurpose::ConsentRender,
    ConsentPurpose::ConsentExport,
    ConsentPurpose::ConsentShare,
];

/// `GrantConsent`.
pub(super) async fn grant(
    context: &Context,
    tenant: &Tenant,
    request: GrantConsentRequest,
) -> Result<Consent, RequestError> {
    let key = fields::request_key("GrantConsent", &request.request_id, &request);
    let id = fields::id(Collection::Subjects, "subject", &request.subject);
    let purposes = match purposes(&request.purposes) {
        Ok(purposes) if purposes.is_empty() => Err(RequestError::invalid(
            "purposes",
            "a consent needs at least one purpose",
        )),
        other => other,
    };
    let given_by = fields::line("given_by", &request.given_by, OWNER_CHARACTERS);
    let note = fields::lines("note", &request.note, CONSENT_NOTE_BYTES);
    let evidence = evidence(request.evidence, &request.evidence_file_name);
    // What was agreed to for a time that is over is still a record.
    let end = fields::end("expire_time", request.expire_time.as_ref(), None);
    let ((key, id), ((purposes, evidence), ((given_by, ()), expire_time))) = both(
        both(key, id),
        both(both(purposes, evidence), both(both(given_by, note), end)),
    )?;
    let new = NewConsent {
        purposes,
        given_by,
        note: request.note,
        expire_time,
        evidence,
    };
    let consent = context.store.grant_consent(tenant, &id, &new, key).await?;
    tracing::info!(
        subject = consent.subject,
        consent = consent.name,
        "a consent was recorded"
    );
    Ok(consent)
}

/// `RevokeConsent`.
pub(super) async fn revoke(
    context: &Context,
    tenant: &Tenant,
    request: RevokeConsentRequest,
) -> Result<RevokeConsentResponse, RequestError> {
    let key = fields::request_key("RevokeConsent", &request.request_id, &request);
    let id = fields::id(Collection::Subjects, "subject", &request.subject);
    let note = fields::lines("note", &request.note, CONSENT_NOTE_BYTES);
    let ((key, id), (mut purposes, ())) =
        both(both(key, id), both(purposes(&request.purposes), note))?;
    if purposes.is_empty() {
        purposes = PURPOSES.to_vec();
    }
    let store = &context.store;
    (store.revoke_consent(tenant, &id, &purposes, &request.note, key)).await?;
    tracing::info!(subject = request.subject, "a consent was revoked");
    let jobs = consent::stop(context, Some(&id)).await?;
    Ok(RevokeConsentResponse { jobs })
}

/// A file that proves a consent, and its name; neither, or both.
fn evidence(content: Vec<u8>, name: &str) -> Result<Option<NewEvidence>, RequestError> {
    if content.is_empty() && name.is_empty() {
        return Ok(None);
    }
    if content.is_empty() || content.len() > EVIDENCE_BYTES {
        let message = format!("{} bytes; a file has 1 to {EVIDENCE_BYTES}", content.len());
        return Err(RequestError::invalid("evidence", message));
    }
    let file_name = fields::line("evidence_file_name", name, EVIDENCE_NAME_BYTES)?;
    if matches!(&*file_name, "" | "." | "..") || file_name.contains(['/', '\\']) {
        let message = "is the name of a file, without a folder";
        return Err(RequestError::invalid("evidence_file_name", message));
    }
    Ok(Some(NewEvidence { file_name, content }))
}

/// `GetConsentEvidence`.
pub(super) async fn get_evidence(
    context: &Context,
    tenant: &Tenant,
    request: &GetConsentEvidenceRequest,
) -> Result<ConsentEvidence, RequestError> {
    let id = fields::id(Collection::Consents, "name", &request.name)?;
    let file = context.store.consent_evidence(tenant, &id).await?;
    Ok(ConsentEvidence {
        evidence: Some(Evidence {
            bytes: file.content.len() as u64,
            sha256: sha256_hex(&file.content),
            file_name: file.file_name,
        }),
        content: file.content,
    })
}

/// `ListConsents`.
pub(super) async fn list(
    context: &Context,
    tenant: &Tenant,
    request: &ListConsentsRequest,
) -> Result<ListConsentsResponse, RequestError> {
    let (size, token) = (request.page_size, &request.page_token);
    let page = paging::Request::read("consents", size, token, &request.parent);
    let id = fields::id(Collection::Subjects, "parent", &request.parent);
    let (page, id) = both(page, id)?;
    let entries = context.store.consents(tenant, &id, page.page()).await?;
    let (consents, next_page_token) = page.cut(entries);
    Ok(ListConsentsResponse {
        consents,
        next_page_token,
    })
}

/// The purposes with these numbers, each once. An unknown number is refused: nobody knows what was agreed to.
fn purposes(numbers: &[i32]) -> Result<Vec<ConsentPurpose>, RequestError> {
    let known = |number: &i32| {
        let purpose = ConsentPurpose::try_from(*number).ok();
        let purpose = purpose.filter(|it| PURPOSES.contains(it));
        purpose
            .ok_or_else(|| RequestError::invalid("purposes", format!("{number} is not a purpose")))
    };
    let mut purposes = all(numbers.iter().map(known))?;
    purposes.sort_unstable();
    purposes.dedup();
    Ok(purposes)
}
