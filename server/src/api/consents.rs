//! The calls of `yoto.v1.SubjectService` about consent.

use super::{fields, paging};
use crate::context::Context;
use crate::error::RequestError;
use crate::field_faults::{all, both};
use crate::jobs::consent;
use crate::store::NewConsent;
use crate::tenant::Tenant;
use yoto_proto::limits::{CONSENT_NOTE_BYTES, OWNER_CHARACTERS};
use yoto_proto::names::Collection;
use yoto_proto::v1::{
    Consent, ConsentPurpose, GrantConsentRequest, ListConsentsRequest, ListConsentsResponse,
    RevokeConsentRequest, RevokeConsentResponse,
};

/// All purposes.
const PURPOSES: [ConsentPurpose; 4] = [
    ConsentPurpose::ConsentTrain,
    ConsentPurpose::ConsentRender,
    ConsentPurpose::ConsentExport,
    ConsentPurpose::ConsentShare,
];

/// `GrantConsent`.
pub async fn grant(
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
    let ((key, id), (purposes, (given_by, ()))) =
        both(both(key, id), both(purposes, both(given_by, note)))?;
    let end = request.expire_time.as_ref();
    let new = NewConsent {
        purposes,
        given_by,
        note: request.note,
        expire_time: end.map(|it| it.seconds as f64 + f64::from(it.nanos) * 1e-9),
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
pub async fn revoke(
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

/// `ListConsents`.
pub async fn list(
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
