//! Subjects: the people of a service.

use super::{ClientError, YotoClient, request_id, retry::repeat};
use yoto_proto::v1::subject_service_client::SubjectServiceClient;
use yoto_proto::v1::{
    Capture, CreateSubjectRequest, DeleteCaptureRequest, DeleteSubjectRequest, Deleted,
    GetCaptureRequest, GetSubjectRequest, IngestCaptureRequest, ListSubjectsRequest, Subject,
};

impl YotoClient {
    pub(super) fn subject_service(&self) -> SubjectServiceClient<tonic::transport::Channel> {
        SubjectServiceClient::new(self.channel.clone())
    }

    /// Records a person, with the consent under which recordings of them are used.
    ///
    /// # Errors
    /// [`ClientError::Refused`], e.g. for an empty name.
    pub async fn create_subject(
        &self,
        display_name: &str,
        consent_note: &str,
    ) -> Result<Subject, ClientError> {
        let request = CreateSubjectRequest {
            display_name: display_name.to_owned(),
            consent_note: consent_note.to_owned(),
            request_id: request_id(),
        };
        let create = || {
            let (mut service, request) = (self.subject_service(), request.clone());
            async move { service.create_subject(request).await }
        };
        let doing = format!("creating the subject '{display_name}'");
        repeat(create).await.map_err(ClientError::refused(doing))
    }

    /// The subject `name`.
    ///
    /// # Errors
    /// [`ClientError::Refused`] when there is none.
    pub async fn get_subject(&self, name: &str) -> Result<Subject, ClientError> {
        let answer = self
            .subject_service()
            .get_subject(GetSubjectRequest {
                name: name.to_owned(),
            })
            .await;
        Ok(answer
            .map_err(ClientError::refused(format!("reading {name}")))?
            .into_inner())
    }

    /// Every subject, over all pages.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn list_subjects(&self) -> Result<Vec<Subject>, ClientError> {
        let mut service = self.subject_service();
        let (mut subjects, mut page_token) = (Vec::new(), String::new());
        loop {
            let request = ListSubjectsRequest {
                page_size: 1000,
                page_token,
            };
            let page = service
                .list_subjects(request)
                .await
                .map_err(ClientError::refused("listing subjects"))?
                .into_inner();
            subjects.extend(page.subjects);
            page_token = page.next_page_token;
            if page_token.is_empty() {
                return Ok(subjects);
            }
        }
    }

    /// The capture `name`, with the violations found by its ingest job.
    ///
    /// # Errors
    /// [`ClientError::Refused`] when there is none.
    pub async fn get_capture(&self, name: &str) -> Result<Capture, ClientError> {
        let answer = self
            .subject_service()
            .get_capture(GetCaptureRequest {
                name: name.to_owned(),
            })
            .await;
        Ok(answer
            .map_err(ClientError::refused(format!("reading {name}")))?
            .into_inner())
    }

    /// Reads the uploaded files of a capture again, after an ingest job that failed or was cancelled.
    ///
    /// # Errors
    /// [`ClientError::Refused`], e.g. for a capture that is READY.
    pub async fn ingest_capture(&self, name: &str) -> Result<Capture, ClientError> {
        let request = IngestCaptureRequest {
            name: name.to_owned(),
            request_id: request_id(),
        };
        let ingest = || {
            let (mut service, request) = (self.subject_service(), request.clone());
            async move { service.ingest_capture(request).await }
        };
        let doing = format!("reading {name} again");
        repeat(ingest).await.map_err(ClientError::refused(doing))
    }

    /// Deletes a person and their captures, if its version is still `etag`; an empty `etag` accepts any
    /// version.
    ///
    /// # Errors
    /// [`ClientError::Refused`], e.g. while a model has them.
    pub async fn delete_subject(&self, name: &str, etag: &str) -> Result<Deleted, ClientError> {
        let request = DeleteSubjectRequest {
            name: name.to_owned(),
            request_id: request_id(),
            etag: etag.to_owned(),
        };
        let delete = || {
            let (mut service, request) = (self.subject_service(), request.clone());
            async move { service.delete_subject(request).await }
        };
        let doing = format!("deleting {name}");
        repeat(delete).await.map_err(ClientError::refused(doing))
    }

    /// Deletes a capture, if its version is still `etag`; an empty `etag` accepts any version.
    ///
    /// # Errors
    /// [`ClientError::Refused`], e.g. while a job uses it.
    pub async fn delete_capture(&self, name: &str, etag: &str) -> Result<Deleted, ClientError> {
        let request = DeleteCaptureRequest {
            name: name.to_owned(),
            request_id: request_id(),
            etag: etag.to_owned(),
        };
        let delete = || {
            let (mut service, request) = (self.subject_service(), request.clone());
            async move { service.delete_capture(request).await }
        };
        let doing = format!("deleting {name}");
        repeat(delete).await.map_err(ClientError::refused(doing))
    }
}
