//! Uploads, as a client makes them.

use super::{File, Service, chunks, file, headers, id};
use futures::stream;
use std::path::PathBuf;
use tonic::Status;
use yoto_proto::keys;
use yoto_proto::v1::{
    Capture, CreateUploadRequest, FinishUploadRequest, GetUploadRequest, Upload, WriteUploadRequest,
};
use yoto_proto::worker::v1::Lease;

impl Service {
    /// Opens an upload of `files`.
    pub(crate) async fn open_upload(
        &self,
        subject: &str,
        files: &[File],
    ) -> Result<Upload, Status> {
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
    pub(crate) async fn write(&self, messages: Vec<WriteUploadRequest>) -> Result<u64, Status> {
        let written = self.uploads().write_upload(stream::iter(messages)).await;
        written.map(|answer| answer.into_inner().committed_bytes)
    }

    /// An upload, after its writer has stopped.
    pub(crate) async fn get_upload(&self, name: &str) -> Result<Upload, Status> {
        let request = GetUploadRequest {
            name: name.into(),
            stop_writer: true,
        };
        let upload = self.uploads().get_upload(request).await;
        upload.map(|answer| answer.into_inner())
    }

    pub(crate) async fn finish(&self, upload: &str) -> Result<Capture, Status> {
        let request = FinishUploadRequest {
            name: upload.into(),
            request_id: String::new(),
        };
        let finished = self.uploads().finish_upload(request).await;
        finished.map(|answer| answer.into_inner())
    }

    /// Uploads `files` in one stream.
    pub(crate) async fn upload(&self, subject: &str, files: Vec<File>) -> Result<Capture, Status> {
        let upload = self.open_upload(subject, &files).await?.name;
        self.write(chunks(&upload, &files)).await?;
        self.finish(&upload).await
    }

    pub(crate) async fn upload_good(&self, subject: &str) -> Capture {
        let files = vec![
            file("poses.json", b"{}"),
            file("frames/000000.png", b"not looked at"),
        ];
        self.upload(subject, files).await.expect("uploads")
    }

    /// The content of the file `path`, put together from the parts in the order of its ingest job.
    pub(crate) fn ingested(&self, lease: &Lease, path: &str) -> Vec<u8> {
        Self::ingested_from(lease, path, |key| self.path(key))
    }

    /// The same from objects that are in the files which `place` tells.
    pub(crate) fn ingested_from(
        lease: &Lease,
        path: &str,
        place: impl Fn(&str) -> PathBuf,
    ) -> Vec<u8> {
        let inputs = lease.inputs.clone().expect("has inputs");
        let file = inputs.files.into_iter().find(|file| file.path == path);
        let file = file.expect("is in the order");
        if let Some(object) = file.object {
            return std::fs::read(place(&object.key)).expect("is stored");
        }
        let mut content = Vec::new();
        for piece in file.pieces {
            let part = &inputs.parts[piece.part as usize];
            let stored = std::fs::read(place(&part.key)).expect("is stored");
            let sha256 = yoto_proto::sha256_hex(&stored);
            assert!(
                part.sha256.is_empty() || part.sha256 == sha256,
                "{}",
                part.key
            );
            let (start, end) = (piece.start as usize, (piece.start + piece.bytes) as usize);
            content.extend_from_slice(&stored[start..end]);
        }
        assert_eq!(content.len() as u64, file.bytes);
        assert_eq!(yoto_proto::sha256_hex(&content), file.sha256);
        content
    }

    /// Leases the ingest job of the newest upload.
    pub(crate) async fn ingest_lease(&self) -> Lease {
        let worker = self.worker(&["ingest"]).await;
        self.lease(&worker).await.expect("the ingest job waits")
    }

    /// The files of the upload's parts, with their sizes.
    pub(crate) fn parts(&self, upload: &str) -> Vec<(PathBuf, u64)> {
        let folder = self.path(&keys::upload_parts(id(upload)));
        let entries = std::fs::read_dir(folder).expect("lists");
        let parts = entries.map(|entry| {
            let entry = entry.expect("an entry");
            (entry.path(), entry.metadata().expect("is there").len())
        });
        parts.collect()
    }
}
