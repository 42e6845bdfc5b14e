//! `yoto.v1.SubjectService`.

use super::{consents, erasures, fields, paging};
use crate::context::Context;
use crate::uploads;
use std::sync::Arc;
use tonic::{Request, Response, Status};
use yoto_proto::limits;
use yoto_proto::names::Collection;
use yoto_proto::v1::subject_service_server::SubjectService;
use yoto_proto::v1::{
    Capture, Consent, ConsentEvidence, CreateSubjectRequest, DeleteCaptureRequest,
    DeleteSubjectRequest, Deleted, EraseSubjectRequest, Erasure, GetCaptureRequest,
    GetConsentEvidenceRequest, GetErasureRequest, GetSubjectRequest, GrantConsentRequest,
    IngestCaptureRequest, ListCapturesRequest, ListCapturesResponse, ListConsentsRequest,
    ListConsentsResponse, ListErasuresRequest, ListErasuresResponse, ListSubjectsRequest,
    ListSubjectsResponse, RevokeConsentRequest, RevokeConsentResponse, Subject,
    UpdateSubjectRequest,
};
use yoto_request::validation::{all, both};
use yoto_request::{RequestError, tenant_of};
use yoto_store::{NewSubject, SubjectChange, Target};

/// People, and the captures of them.
pub(crate) struct SubjectApi {
    /// The shared parts.
    pub context: Arc<Context>,
}

/// What the fields at `paths` of `subject` say.
fn subject_change(subject: &Subject, paths: &[String]) -> Result<SubjectChange, RequestError> {
    let mut change = SubjectChange::default();
    let mut faults = Vec::new();
    for path in paths {
        let found = match path.as_str() {
            "display_name" => fields::display_name(&subject.display_name)
                .map(|name| change.display_name = Some(name)),
            "consent_note" => {
                let note = &subject.consent_note;
                fields::lines("consent_note", note, limits::CONSENT_NOTE_BYTES)
                    .map(|()| change.consent_note = Some(note.clone()))
            }
            other => {
                let message = format!("'{other}' can't be changed");
                Err(RequestError::invalid("update_mask", message))
            }
        };
        faults.push(found);
    }
    if paths.is_empty() {
        faults.push(Err(RequestError::invalid("update_mask", "names no field")));
    }
    all(faults).map(|_| change)
}

#[tonic::async_trait]
impl SubjectService for SubjectApi {
    async fn create_subject(
        &self,
        request: Request<CreateSubjectRequest>,
    ) -> Result<Response<Subject>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.into_inner();
        let key = fields::request_key("CreateSubject", &request.request_id, &request)?;
        let store = &self.context.store;
        // Comes before every check: a repeated request gets its first answer.
        if let Some(id) = store
            .answered(&tenant, key.as_ref().filter(|_| !request.validate_only))
            .await
            .map_err(RequestError::from)?
        {
            let subject = store.subject(&tenant, &id).await;
            return Ok(Response::new(subject.map_err(RequestError::from)?));
        }
        let note = &request.consent_note;
        let display_name = fields::display_name(&request.display_name);
        let note = fields::lines("consent_note", note, limits::CONSENT_NOTE_BYTES);
        let (display_name, ()) = both(display_name, note)?;
        if request.validate_only {
            return Ok(Response::new(Subject {
                display_name,
                consent_note: request.consent_note,
                ..Subject::default()
            }));
        }
        let new = NewSubject {
            display_name,
            consent_note: request.consent_note,
        };
        let subject = store.create_subject(&tenant, new, key).await;
        Ok(Response::new(subject.map_err(RequestError::from)?))
    }

    async fn get_subject(
        &self,
        request: Request<GetSubjectRequest>,
    ) -> Result<Response<Subject>, Status> {
        let tenant = tenant_of(&request)?;
        let id = fields::id(Collection::Subjects, "name", &request.get_ref().name)?;
        let subject = self.context.store.subject(&tenant, &id).await;
        Ok(Response::new(subject.map_err(RequestError::from)?))
    }

    async fn list_subjects(
        &self,
        request: Request<ListSubjectsRequest>,
    ) -> Result<Response<ListSubjectsResponse>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.get_ref();
        let page = paging::Request::read("subjects", request.page_size, &request.page_token, &())?;
        let entries = self.context.store.subjects(&tenant, page.page()).await;
        let (subjects, next_page_token) = page.cut(entries.map_err(RequestError::from)?);
        Ok(Response::new(ListSubjectsResponse {
            subjects,
            next_page_token,
        }))
    }

    async fn update_subject(
        &self,
        request: Request<UpdateSubjectRequest>,
    ) -> Result<Response<Subject>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.into_inner();
        let subject = request.subject.unwrap_or_default();
        let id = fields::id(Collection::Subjects, "subject.name", &subject.name);
        let change = subject_change(&subject, &request.update_mask.unwrap_or_default().paths);
        let (id, change) = both(id, change)?;
        let store = &self.context.store;
        let changed = store
            .update_subject(&tenant, &id, change, &subject.etag)
            .await;
        Ok(Response::new(changed.map_err(RequestError::from)?))
    }

    async fn get_capture(
        &self,
        request: Request<GetCaptureRequest>,
    ) -> Result<Response<Capture>, Status> {
        let tenant = tenant_of(&request)?;
        let id = fields::id(Collection::Captures, "name", &request.get_ref().name)?;
        let capture = self.context.store.capture(&tenant, &id).await;
        Ok(Response::new(capture.map_err(RequestError::from)?))
    }

    async fn list_captures(
        &self,
        request: Request<ListCapturesRequest>,
    ) -> Result<Response<ListCapturesResponse>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.get_ref();
        let (size, token) = (request.page_size, &request.page_token);
        let page = paging::Request::read("captures", size, token, &request.parent);
        let subject = match &*request.parent {
            "" => Ok(None),
            name => fields::id(Collection::Subjects, "parent", name).map(Some),
        };
        let (page, subject) = both(page, subject)?;
        let store = &self.context.store;
        let entries = store
            .captures(&tenant, page.page(), subject.as_deref())
            .await;
        let (captures, next_page_token) = page.cut(entries.map_err(RequestError::from)?);
        Ok(Response::new(ListCapturesResponse {
            captures,
            next_page_token,
        }))
    }

    async fn ingest_capture(
        &self,
        request: Request<IngestCaptureRequest>,
    ) -> Result<Response<Capture>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.get_ref();
        let key = fields::request_key("IngestCapture", &request.request_id, request)?;
        let id = fields::id(Collection::Captures, "name", &request.name)?;
        let capture = uploads::ingest_again(&self.context, &tenant, &id, key).await?;
        Ok(Response::new(capture))
    }

    async fn delete_subject(
        &self,
        request: Request<DeleteSubjectRequest>,
    ) -> Result<Response<Deleted>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.get_ref();
        let key = fields::request_key("DeleteSubject", &request.request_id, request)?;
        let id = fields::id(Collection::Subjects, "name", &request.name)?;
        let deleted = (self.context.store)
            .delete(&tenant, Target::Subject(&id), &request.etag, key)
            .await;
        Ok(Response::new(deleted.map_err(RequestError::from)?))
    }

    async fn delete_capture(
        &self,
        request: Request<DeleteCaptureRequest>,
    ) -> Result<Response<Deleted>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.get_ref();
        let key = fields::request_key("DeleteCapture", &request.request_id, request)?;
        let id = fields::id(Collection::Captures, "name", &request.name)?;
        let deleted = (self.context.store)
            .delete(&tenant, Target::Capture(&id), &request.etag, key)
            .await;
        Ok(Response::new(deleted.map_err(RequestError::from)?))
    }

    async fn grant_consent(
        &self,
        request: Request<GrantConsentRequest>,
    ) -> Result<Response<Consent>, Status> {
        let tenant = tenant_of(&request)?;
        let consent = consents::grant(&self.context, &tenant, request.into_inner()).await?;
        Ok(Response::new(consent))
    }

    async fn revoke_consent(
        &self,
        request: Request<RevokeConsentRequest>,
    ) -> Result<Response<RevokeConsentResponse>, Status> {
        let tenant = tenant_of(&request)?;
        let revoked = consents::revoke(&self.context, &tenant, request.into_inner()).await?;
        Ok(Response::new(revoked))
    }

    async fn list_consents(
        &self,
        request: Request<ListConsentsRequest>,
    ) -> Result<Response<ListConsentsResponse>, Status> {
        let tenant = tenant_of(&request)?;
        let listed = consents::list(&self.context, &tenant, request.get_ref()).await?;
        Ok(Response::new(listed))
    }

    async fn get_consent_evidence(
        &self,
        request: Request<GetConsentEvidenceRequest>,
    ) -> Result<Response<ConsentEvidence>, Status> {
        let tenant = tenant_of(&request)?;
        let found = consents::get_evidence(&self.context, &tenant, request.get_ref()).await?;
        Ok(Response::new(found))
    }

    async fn erase_subject(
        &self,
        request: Request<EraseSubjectRequest>,
    ) -> Result<Response<Erasure>, Status> {
        let tenant = tenant_of(&request)?;
        let begun = erasures::begin(&self.context, &tenant, request.get_ref()).await?;
        Ok(Response::new(begun))
    }

    async fn get_erasure(
        &self,
        request: Request<GetErasureRequest>,
    ) -> Result<Response<Erasure>, Status> {
        let tenant = tenant_of(&request)?;
        let found = erasures::get(&self.context, &tenant, request.get_ref()).await?;
        Ok(Response::new(found))
    }

    async fn list_erasures(
        &self,
        request: Request<ListErasuresRequest>,
    ) -> Result<Response<ListErasuresResponse>, Status> {
        let tenant = tenant_of(&request)?;
        let listed = erasures::list(&self.context, &tenant, request.get_ref()).await?;
        Ok(Response::new(listed))
    }
}
