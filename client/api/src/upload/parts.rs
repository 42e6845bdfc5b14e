//! Parts of an upload that go into the object store by themselves, where the service signs URLs and the store can be reached.
//! The service commits each, and a stream takes the rest.

use super::plan::{Part, Plan};
use super::{Meter, UploadFile};
use crate::direct::DirectError;
use crate::{ClientError, YotoClient};
use std::sync::Arc;
use tokio::task::JoinSet;
use tonic::{Code, Status};
use yoto_proto::reasons;
use yoto_proto::v1::{
    CommitPartRequest, ErrorReason, FileHeader, NewPart, SignPartsRequest, SignedPart, Upload,
};

/// Parts that are in memory and under way at once.
const AT_ONCE: usize = 4;

/// A writer of parts.
struct Writer<'a> {
    client: &'a YotoClient,
    /// `uploads/{id}`.
    upload: &'a str,
    /// Its number; 0 before the first call.
    number: u64,
    /// Number of the next part.
    next: u32,
}

/// Why no further part is written.
enum WriteEnd {
    /// A stream takes the rest, unless a part was committed since the last try.
    Store(String),
    /// The service refuses or fails.
    Service(Status),
}

impl YotoClient {
    /// Writes what `upload` does not have into the store, but less than a part. Returns the number of bytes that the service
    /// has committed; the inner error is the service's. After 0, the rest is for a stream.
    ///
    /// # Errors
    /// [`ClientError::File`] when a file can't be read or has changed.
    pub(super) async fn write_store<F: FnMut(u64)>(
        &self,
        upload: &Upload,
        files: &[UploadFile],
        headers: &[FileHeader],
        meter: &mut Meter<F>,
    ) -> Result<Result<u64, Status>, ClientError> {
        let rest = upload.bytes.saturating_sub(upload.committed_bytes);
        // Less than a part has arrived in a stream by the time that the first URL would take.
        if !self.direct.writes.is_on() || rest < upload.part_bytes.max(1) {
            return Ok(Ok(0));
        }
        let mut plan = Plan::new(upload, files, headers);
        let mut writer = Writer {
            client: self,
            upload: &upload.name,
            number: 0,
            next: 0,
        };
        let mut committed = 0;
        meter.reached(upload.committed_bytes);
        loop {
            let mut parts = Vec::with_capacity(AT_ONCE);
            while parts.len() < AT_ONCE
                && let Some(part) = plan.next().await?
            {
                parts.push(part);
            }
            if parts.is_empty() {
                return Ok(Ok(committed));
            }
            let before = committed;
            let on_commit = |bytes| {
                committed += bytes;
                meter.reached(upload.committed_bytes + committed);
            };
            let written = writer.write(parts, on_commit).await;
            match written {
                Ok(()) => {}
                Err(WriteEnd::Service(status)) => return Ok(Err(status)),
                Err(WriteEnd::Store(why)) => {
                    if committed == before {
                        self.direct.writes.give_up(&why);
                    }
                    return Ok(Ok(committed));
                }
            }
        }
    }
}

impl Writer<'_> {
    /// Writes `parts` at once and has the service commit them one by one; `on_commit` receives the size of each. The first one
    /// that fails is the last.
    async fn write(
        &mut self,
        parts: Vec<Part>,
        mut on_commit: impl FnMut(u64),
    ) -> Result<(), WriteEnd> {
        let new: Vec<NewPart> = (self.next..)
            .zip(&parts)
            .map(|(number, part)| NewPart {
                number,
                bytes: part.bytes,
                sha256: part.sha256.clone(),
            })
            .collect();
        self.next += new.len() as u32;
        let signed = self.sign(new.clone()).await?;
        let written = self.put(&parts, signed).await;
        for ((part, new), written) in parts.into_iter().zip(new).zip(written) {
            written.map_err(|fault| WriteEnd::Store(fault.to_string()))?;
            let bytes = part.bytes;
            self.commit(part, new).await?;
            on_commit(bytes);
        }
        Ok(())
    }

    async fn sign(&mut self, parts: Vec<NewPart>) -> Result<Vec<SignedPart>, WriteEnd> {
        let asked = parts.len();
        let request = SignPartsRequest {
            upload: self.upload.to_owned(),
            writer: self.number,
            parts,
        };
        let answer = match self.client.upload_service().sign_parts(request).await {
            Ok(answer) => answer.into_inner(),
            Err(status) if status.code() == Code::Unimplemented => {
                let why = "the service is of an earlier version";
                return Err(WriteEnd::Store(why.into()));
            }
            Err(status) => return Err(WriteEnd::Service(status)),
        };
        if answer.parts.len() != asked {
            return Err(WriteEnd::Store("the service signs no URLs".into()));
        }
        self.number = answer.writer;
        Ok(answer.parts)
    }

    /// What becomes of each part.
    async fn put(&self, parts: &[Part], signed: Vec<SignedPart>) -> Vec<Result<(), DirectError>> {
        let mut tasks = JoinSet::new();
        for (at, (part, signed)) in parts.iter().zip(signed).enumerate() {
            let (direct, chunks) = (Arc::clone(&self.client.direct), part.chunks.clone());
            tasks.spawn(async move {
                let SignedPart { url, headers } = &signed;
                (at, direct.put(url, headers, &chunks).await)
            });
        }
        let mut written: Vec<_> = parts.iter().map(|_| Err(DirectError::Timeout)).collect();
        while let Some(done) = tasks.join_next().await {
            if let Ok((at, outcome)) = done {
                written[at] = outcome;
            }
        }
        written
    }

    async fn commit(&self, part: Part, new: NewPart) -> Result<(), WriteEnd> {
        let request = CommitPartRequest {
            upload: self.upload.to_owned(),
            writer: self.number,
            part: Some(new),
            pieces: part.pieces,
        };
        let Err(status) = self.client.upload_service().commit_part(request).await else {
            return Ok(());
        };
        match reasons::of(&status) {
            Some(ErrorReason::UploadIncomplete) => {
                let why = "the service does not find the part that was written";
                Err(WriteEnd::Store(why.into()))
            }
            _ => Err(WriteEnd::Service(status)),
        }
    }
}
