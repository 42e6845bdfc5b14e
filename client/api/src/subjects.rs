//! Subjects: the people of a service.

use super::retry::{read, repeat};
use super::{ClientError, YotoClient, request_id};
use prost_types::FieldMask;
use yoto_proto::key::Connection;
use yoto_proto::limits::{ANSWER_BYTES, LONGEST_PAGE_ENTRIES};
use yoto_proto::v1::subject_service_client::SubjectServiceClient;
use yoto_proto::v1::{
    Capture, CreateSubjectRequest, DeleteCaptureRequest, DeleteSubjectRequest, Deleted,
    GetCaptureRequest, GetSubjectRequest, IngestCaptureRequest, ListCapturesRequest,
    ListSubjectsRequest, Subject, UpdateSubjectRequest,
};

impl YotoClient {
    pub(super) fn subject_service(&self) -> SubjectServiceClient<Connection> {
        SubjectServiceClient::new(self.channel.clone()).max_decoding_message_size(ANSWER_BYTES)
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
            validate_only: false,
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
        let get = || {
            let (mut service, name) = (self.subject_service(), name.to_owned());
            async move { service.get_subject(GetSubjectRequest { name }).await }
        };
        let found = read(get).await;
        found.map_err(ClientError::refused(format!("reading {name}")))
    }

    /// Every subject, over all pages.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn list_subjects(&self) -> Result<Vec<Subject>, ClientError> {
        let service = self.subject_service();
        let (mut subjects, mut page_token) = (Vec::new(), String::new());
        loop {
            let request = ListSubjectsRequest {
                page_size: 1000,
                page_token,
            };
            let list = || {
                let (mut service, request) = (service.clone(), request.clone());
                async move { service.list_subjects(request).await }
            };
            let page = read(list).await;
            let page = page.map_err(ClientError::refused("listing subjects"))?;
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
        let get = || {
            let (mut service, name) = (self.subject_service(), name.to_owned());
            async move { service.get_capture(GetCaptureRequest { name }).await }
        };
        let found = read(get).await;
        found.map_err(ClientError::refused(format!("reading {name}")))
    }

    /// Changes the display name or the consent note of a person, if they still have the version in `subject`.
    ///
    /// # Errors
    /// [`ClientError::Refused`], e.g. for an empty name.
    pub async fn update_subject(
        &self,
        subject: &Subject,
        display_name: Option<&str>,
        consent_note: Option<&str>,
    ) -> Result<Subject, ClientError> {
        let named = [
            ("display_name", display_name),
            ("consent_note", consent_note),
        ];
        let paths = named.iter().filter(|it| it.1.is_some());
        let request = UpdateSubjectRequest {
            subject: Some(Subject {
                name: subject.name.clone(),
                etag: subject.etag.clone(),
                display_name: display_name.unwrap_or_default().to_owned(),
                consent_note: consent_note.unwrap_or_default().to_owned(),
                ..Subject::default()
            }),
            update_mask: Some(FieldMask {
                paths: paths.map(|it| it.0.to_owned()).collect(),
            }),
        };
        // Not repeated: after a lost answer, the version is another one.
        let answer = self.subject_service().update_subject(request).await;
        let doing = format!("changing {}", subject.display_name);
        Ok(answer.map_err(ClientError::refused(doing))?.into_inner())
    }

    /// The captures of the person `subject`, or of all people if it is empty, over all pages.
    ///
    /// # Errors
    /// [`ClientError::Refused`] when there is no such person.
    pub async fn list_captures(&self, subject: &str) -> Result<Vec<Capture>, ClientError> {
        let (mut captures, mut page_token) = (Vec::new(), String::new());
        loop {
            let request = ListCapturesRequest {
                parent: subject.to_owned(),
                page_size: LONGEST_PAGE_ENTRIES as i32,
                page_token,
            };
            let list = || {
                let (mut service, request) = (self.subject_service(), request.clone());
                async move { service.list_captures(request).await }
            };
            let page = repeat(list).await;
            let page = page.map_err(ClientError::refused("listing captures"))?;
            captures.extend(page.captures);
            page_token = page.next_page_token;
            if page_token.is_empty() {
                return Ok(captures);
            }
        }
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
