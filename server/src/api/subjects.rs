//! `yoto.v1.SubjectService`.

use super::{fields, paging};
use crate::context::Context;
use crate::error::RequestError;
use crate::field_faults::both;
use crate::store::{NewSubject, Target};
use crate::uploads;
use std::sync::Arc;
use tonic::{Request, Response, Status};
use yoto_proto::limits;
use yoto_proto::names::Collection;
use yoto_proto::v1::subject_service_server::SubjectService;
use yoto_proto::v1::{
    Capture, CreateSubjectRequest, DeleteCaptureRequest, DeleteSubjectRequest, Deleted,
    GetCaptureRequest, GetSubjectRequest, IngestCaptureRequest, ListSubjectsRequest,
    ListSubjectsResponse, Subject,
};

/// People, and the captures of them.
pub struct SubjectApi {
    /// The shared parts.
    pub context: Arc<Context>,
}

#[tonic::async_trait]
impl SubjectService for SubjectApi {
    async fn create_subject(
        &self,
        request: Request<CreateSubjectRequest>,
    ) -> Result<Response<Subject>, Status> {
        let request = request.into_inner();
        let key = fields::request_key("CreateSubject", &request.request_id, &request)?;
        let store = &self.context.store;
        // Comes before every check: a repeated request gets its first answer.
        if let Some(id) = store
            .answered(key.as_ref())
            .await
            .map_err(RequestError::from)?
        {
            let subject = store.subject(&id).await;
            return Ok(Response::new(subject.map_err(RequestError::from)?));
        }
        let note = &request.consent_note;
        let display_name = fields::display_name(&request.display_name);
        let note = fields::lines("consent_note", note, limits::CONSENT_NOTE_BYTES);
        let (display_name, ()) = both(display_name, note)?;
        let new = NewSubject {
            display_name,
            consent_note: request.consent_note,
        };
        let subject = store.create_subject(new, key).await;
        Ok(Response::new(subject.map_err(RequestError::from)?))
    }

    async fn get_subject(
        &self,
        request: Request<GetSubjectRequest>,
    ) -> Result<Response<Subject>, Status> {
        let id = fields::id(Collection::Subjects, "name", &request.get_ref().name)?;
        let subject = self.context.store.subject(&id).await;
        Ok(Response::new(subject.map_err(RequestError::from)?))
    }

    async fn list_subjects(
        &self,
        request: Request<ListSubjectsRequest>,
    ) -> Result<Response<ListSubjectsResponse>, Status> {
        let request = request.get_ref();
        let page = paging::Request::read("subjects", request.page_size, &request.page_token, &())?;
        let entries = self.context.store.subjects(page.page()).await;
        let (subjects, next_page_token) = page.cut(entries.map_err(RequestError::from)?);
        Ok(Response::new(ListSubjectsResponse {
            subjects,
            next_page_token,
        }))
    }

    async fn get_capture(
        &self,
        request: Request<GetCaptureRequest>,
    ) -> Result<Response<Capture>, Status> {
        let id = fields::id(Collection::Captures, "name", &request.get_ref().name)?;
        let capture = self.context.store.capture(&id).await;
        Ok(Response::new(capture.map_err(RequestError::from)?))
    }

    async fn ingest_capture(
        &self,
        request: Request<IngestCaptureRequest>,
    ) -> Result<Response<Capture>, Status> {
        let request = request.get_ref();
        let key = fields::request_key("IngestCapture", &request.request_id, request)?;
        let id = fields::id(Collection::Captures, "name", &request.name)?;
        let capture = uploads::ingest_again(&self.context, &id, key).await?;
        Ok(Response::new(capture))
    }

    async fn delete_subject(
        &self,
        request: Request<DeleteSubjectRequest>,
    ) -> Result<Response<Deleted>, Status> {
        let request = request.get_ref();
        let key = fields::request_key("DeleteSubject", &request.request_id, request)?;
        let id = fields::id(Collection::Subjects, "name", &request.name)?;
        let deleted = (self.context.store)
            .delete(Target::Subject(&id), &request.etag, key)
            .await;
        Ok(Response::new(deleted.map_err(RequestError::from)?))
    }

    async fn delete_capture(
        &self,
        request: Request<DeleteCaptureRequest>,
    ) -> Result<Response<Deleted>, Status> {
        let request = request.get_ref();
        let key = fields::request_key("DeleteCapture", &request.request_id, request)?;
        let id = fields::id(Collection::Captures, "name", &request.name)?;
        let deleted = (self.context.store)
            .delete(Target::Capture(&id), &request.etag, key)
            .await;
        Ok(Response::new(deleted.map_err(RequestError::from)?))
    }
}
