//! Uploads, as a client makes them.

use super::{File, Service, chunks, file, headers};
use futures::stream;
use tonic::Status;
use yoto_proto::v1::{
    Capture, CreateUploadRequest, FinishUploadRequest, GetUploadRequest, Upload, WriteUploadRequest,
};

impl Service {
    /// Opens an upload of `files`.
    pub async fn open_upload(&self, subject: &str, files: &[File]) -> Result<Upload, Status> {
        let request = CreateUploadRequest {
            subject: subject.into(),
            files: headers(files),
            request_id: String::new(),
            validate_only: false,
        };
        let opened = self.uploads().create_upload(request).await;
        opened.map(|answer| answer.into_inner())
    }

    /// Sends `messages` in one stream. Returns the committed bytes.
    pub async fn write(&self, messages: Vec<WriteUploadRequest>) -> Result<u64, Status> {
        let written = self.uploads().write_upload(stream::iter(messages)).await;
        written.map(|answer| answer.into_inner().committed_bytes)
    }

    /// An upload, after its writer has stopped.
    pub async fn get_upload(&self, name: &str) -> Result<Upload, Status> {
        let request = GetUploadRequest {
            name: name.into(),
            stop_writer: true,
        };
        let upload = self.uploads().get_upload(request).await;
        upload.map(|answer| answer.into_inner())
    }

    pub async fn finish(&self, upload: &str) -> Result<Capture, Status> {
        let request = FinishUploadRequest {
            name: upload.into(),
            request_id: String::new(),
        };
        let finished = self.uploads().finish_upload(request).await;
        finished.map(|answer| answer.into_inner())
    }

    /// Uploads `files` in one stream.
    pub async fn upload(&self, subject: &str, files: Vec<File>) -> Result<Capture, Status> {
        let upload = self.open_upload(subject, &files).await?.name;
        self.write(chunks(&upload, &files)).await?;
        self.finish(&upload).await
    }

    pub async fn upload_good(&self, subject: &str) -> Capture {
        let files = vec![
            file("poses.json", b"{}"),
            file("frames/000000.png", b"not looked at"),
        ];
        self.upload(subject, files).await.expect("uploads")
    }
}
