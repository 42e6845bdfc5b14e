//! `yoto.v1.SubjectService`.

use super::{fields, paging};
use crate::{
    context::Context,
    error::RequestError,
    objects::upload,
    store::{NewSubject, Target},
};
use std::sync::Arc;
use tonic::{Request, Response, Status, Streaming};
use yoto_proto::{
    names::Collection,
    v1::{
        Capture, CreateSubjectRequest, DeleteCaptureRequest, DeleteSubjectRequest, Deleted,
        GetCaptureRequest, GetSubjectRequest, ListSubjectsRequest, ListSubjectsResponse, Subject,
        UploadCaptureRequest, UploadCaptureResponse, subject_service_server::SubjectService,
    },
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
        if request.consent_note.len() > fields::MAX_CONSENT_NOTE {
            let message = format!("is longer than {} bytes", fields::MAX_CONSENT_NOTE);
            return Err(RequestError::invalid("consent_note", message).into());
        }
        let new = NewSubject {
            display_name: fields::display_name(&request.display_name)?,
            consent_note: request.consent_note,
        };
        let subject = self.context.store.create_subject(new, key).await;
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
        let page = paging::Request::read("subjects", request.page_size, &request.page_token)?;
        let entries = self.context.store.subjects(page.page()).await;
        let (subjects, next_page_token) = page.cut(entries.map_err(RequestError::from)?);
        Ok(Response::new(ListSubjectsResponse {
            subjects,
            next_page_token,
        }))
    }

    async fn upload_capture(
        &self,
        request: Request<Streaming<UploadCaptureRequest>>,
    ) -> Result<Response<UploadCaptureResponse>, Status> {
        // A separate task: when the caller disconnects, this future is dropped, but the
        // upload must run until it has removed its files.
        let receiving = upload::receive(Arc::clone(&self.context), request.into_inner());
        let capture = tokio::spawn(receiving).await.map_err(|error| {
            tracing::error!(%error, "an upload task ended early");
            Status::internal("the upload ended early")
        })??;
        let ingest_job = capture.ingest_job.clone();
        Ok(Response::new(UploadCaptureResponse {
            capture: Some(capture),
            ingest_job,
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

    async fn delete_subject(
        &self,
        request: Request<DeleteSubjectRequest>,
    ) -> Result<Response<Deleted>, Status> {
        let id = fields::id(Collection::Subjects, "name", &request.get_ref().name)?;
        let deleted = self.context.store.delete(Target::Subject(&id)).await;
        Ok(Response::new(deleted.map_err(RequestError::from)?))
    }

    async fn delete_capture(
        &self,
        request: Request<DeleteCaptureRequest>,
    ) -> Result<Response<Deleted>, Status> {
        let id = fields::id(Collection::Captures, "name", &request.get_ref().name)?;
        let deleted = self.context.store.delete(Target::Capture(&id)).await;
        Ok(Response::new(deleted.map_err(RequestError::from)?))
    }
}
