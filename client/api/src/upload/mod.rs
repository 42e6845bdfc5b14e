//! Uploads of captures, which continue after a lost connection, a restart of the service, and a restart
//! of this program.

mod fits;
mod parts;
mod plan;
mod send;
mod source;

pub(super) use source::measure;
pub use source::{FileSource, UploadFile};

use super::retry::{Retries, repeat};
use super::{ClientError, YotoClient, request_id};
use prost::Message;
use send::send;
use std::collections::HashMap;
use tonic::Status;
use yoto_proto::key::Connection;
use yoto_proto::limits::ANSWER_BYTES;
use yoto_proto::reasons;
use yoto_proto::v1::upload_service_client::UploadServiceClient;
use yoto_proto::v1::{
    Capture, CreateUploadRequest, ErrorReason, FileHeader, FinishUploadRequest, GetUploadRequest,
    Upload, upload,
};

/// Number of times that the committed bytes of one upload may differ from what this program expects. After more, the
/// service's disk counts as broken, or another program as the writer.
const MISMATCHES: u32 = 3;

impl YotoClient {
    fn upload_service(&self) -> UploadServiceClient<Connection> {
        UploadServiceClient::new(self.channel.clone()).max_decoding_message_size(ANSWER_BYTES)
    }

    /// Uploads one capture of `subject` and starts its ingest job. `on_bytes` receives the number of
    /// bytes committed since its last call, those of an earlier attempt first.
    ///
    /// An open upload of the same files is continued, even that of another process.
    ///
    /// # Errors
    /// [`ClientError::BadCapture`] when the service's limits forbid it, before anything is read;
    /// [`ClientError::File`] when a file can't be read; [`ClientError::Refused`], also when the service
    /// stays out of reach for a minute.
    pub async fn upload_capture(
        &self,
        subject: &str,
        files: Vec<UploadFile>,
        on_bytes: impl FnMut(u64),
    ) -> Result<Capture, ClientError> {
        let refused = || ClientError::refused(format!("uploading a capture of {subject}"));
        self.fits(&files).await?;
        let mut headers = Vec::with_capacity(files.len());
        for file in &files {
            headers.push(file.header().await?);
        }
        let mut upload = self.open_upload(subject, headers.clone()).await?;
        let mut meter = Meter { on_bytes, told: 0 };
        let mut retries = Retries::new();
        let mut mismatches = 0;
        loop {
            let service = self.upload_service();
            let sent = match (self.write_store(&upload, &files, &headers, &mut meter)).await? {
                Ok(0) => send(service, &upload, &files, &headers, &mut meter).await?,
                Ok(_) => {
                    retries.reset();
                    upload = self.get_upload(&upload.name).await?;
                    continue;
                }
                Err(status) => Err(status),
            };
            let status = match sent {
                Ok(()) => match self.finish_upload(&upload.name).await {
                    Ok(capture) => return Ok(capture),
                    Err(status) => status,
                },
                Err(status) => status,
            };
            if reasons::of(&status) == Some(ErrorReason::UploadIncomplete) {
                // Bytes are lost or altered, and a stream's chunks have checksums.
                self.direct.writes.give_up("the service misses bytes");
            }
            if mismatches < MISMATCHES && is_mismatch(&status) {
                mismatches += 1;
            } else {
                retries.wait(status).await.map_err(refused())?;
            }
            let before = upload.committed_bytes;
            upload = self.get_upload(&upload.name).await?;
            if upload.committed_bytes > before {
                retries.reset();
            }
        }
    }

    async fn finish_upload(&self, name: &str) -> Result<Capture, Status> {
        let request = FinishUploadRequest {
            name: name.to_owned(),
            request_id: request_id(),
        };
        let finish = || {
            let (mut service, request) = (self.upload_service(), request.clone());
            async move { service.finish_upload(request).await }
        };
        repeat(finish).await
    }

    /// Opens an upload, or finds the open one of the same files.
    async fn open_upload(
        &self,
        subject: &str,
        files: Vec<FileHeader>,
    ) -> Result<Upload, ClientError> {
        let mut request = CreateUploadRequest {
            subject: subject.to_owned(),
            files,
            request_id: String::new(),
            validate_only: false,
        };
        // After a crash, the same files find the upload that has some of their bytes.
        request.request_id = yoto_proto::sha256_hex(&request.encode_to_vec());
        loop {
            let create = || {
                let (mut service, request) = (self.upload_service(), request.clone());
                async move { service.create_upload(request).await }
            };
            let doing = format!("uploading a capture of {subject}");
            let upload = repeat(create).await.map_err(ClientError::refused(doing))?;
            if upload.state() == upload::State::Open {
                // An earlier writer may have left a connection that still counts as open.
                return self.get_upload(&upload.name).await;
            }
            // It was uploaded before, and is uploaded again.
            request.request_id = request_id();
        }
    }

    /// The state of the upload `name`, once no earlier call writes to it.
    async fn get_upload(&self, name: &str) -> Result<Upload, ClientError> {
        let request = GetUploadRequest {
            name: name.to_owned(),
            stop_writer: true,
        };
        let get = || {
            let (mut service, request) = (self.upload_service(), request.clone());
            async move { service.get_upload(request).await }
        };
        let doing = format!("continuing {name}");
        repeat(get).await.map_err(ClientError::refused(doing))
    }
}

/// Whether the committed bytes of the upload differ from what this program expects: the service's disk has lost some, which
/// must be sent again, or an earlier call of this program has arrived late.
fn is_mismatch(status: &Status) -> bool {
    matches!(
        reasons::of(status),
        Some(
            ErrorReason::UploadIncomplete
                | ErrorReason::UploadOffset
                | ErrorReason::UploadTakenOver
        )
    )
}

/// Committed bytes of the files that have some.
fn committed(upload: &Upload) -> HashMap<&str, u64> {
    let files = upload.committed.iter();
    files.map(|it| (it.path.as_str(), it.bytes)).collect()
}

/// Reports the progress of an upload; bytes that are sent again count once.
struct Meter<F> {
    on_bytes: F,
    told: u64,
}

impl<F: FnMut(u64)> Meter<F> {
    /// Of all files, `bytes` are committed.
    fn reached(&mut self, bytes: u64) {
        if let Some(more) = bytes.checked_sub(self.told).filter(|more| *more > 0) {
            self.told = bytes;
            (self.on_bytes)(more);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_that_are_sent_again_are_told_once() {
        let mut told = Vec::new();
        let mut meter = Meter {
            on_bytes: |more| told.push(more),
            told: 0,
        };
        for reached in [0, 4, 9, 6, 9, 12] {
            meter.reached(reached);
        }
        assert_eq!(told, [4, 5, 3]);
    }
}
