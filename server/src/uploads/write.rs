//! The bytes of an upload: checked as they arrive, committed in parts.

use super::batch::{Batch, Committer, Writer};
use super::locks::UploadLock;
use super::{open, take_over};
use crate::context::Context;
use bytes::Buf;
use futures::{Stream, StreamExt};
use std::collections::HashMap;
use std::sync::Arc;
use tonic::Status;
use yoto_proto::crc32c;
use yoto_proto::limits::UPLOAD_PIECES;
use yoto_proto::names::Collection;
use yoto_proto::v1::{ErrorReason, WriteUploadRequest, WriteUploadResponse};
use yoto_request::RequestError;
use yoto_store::{StoreError, Tenant};

/// Receives chunks until the stream ends, and commits all valid ones, however it ends.
///
/// # Errors
/// When a chunk has a wrong offset or file, the stream breaks off or falls silent, another call writes to the
/// upload, or the disk fails.
pub(crate) async fn receive<S>(
    context: Arc<Context>,
    tenant: Tenant,
    mut chunks: S,
) -> Result<WriteUploadResponse, RequestError>
where
    S: Stream<Item = Result<WriteUploadRequest, Status>> + Unpin,
{
    let first = within(&context, chunks.next()).await?.transpose();
    let Some(first) = first.map_err(RequestError::Stream)? else {
        return Err(RequestError::invalid("upload", "the stream is empty"));
    };
    let id = Collection::Uploads
        .parse(&first.upload)
        .map_err(|error| RequestError::invalid("upload", error.to_string()))?
        .to_owned();
    let (lock, number) = take_over(&context, &tenant, &id).await?;
    let upload = open(&context, &tenant, &id).await?;
    let by = Writer {
        context: Arc::clone(&context),
        tenant,
        id,
        number,
    };
    let mut writer = Receiver {
        name: first.upload.clone(),
        files: HashMap::with_capacity(upload.files.len()),
        batch: Batch::default(),
        pieces: upload.pieces,
        committer: Committer::new(by, upload.newest),
        part_bytes: context.config.upload.part_bytes,
        bytes: upload.files.iter().map(|file| file.committed).sum(),
    };
    for file in upload.files {
        let file_state = Received {
            next: file.committed,
            end: file.bytes,
        };
        writer.files.insert(file.path, file_state);
    }
    let taken = match writer.take(first).await {
        Ok(()) => writer.take_all(&context, &lock, &mut chunks).await,
        Err(error) => Err(error),
    };
    // An error of the disk matters more than one of the stream.
    writer.end().await?;
    taken?;
    Ok(WriteUploadResponse {
        committed_bytes: writer.bytes,
    })
}

/// The output of `next`, or an error if it takes longer than a client may be silent.
async fn within<T>(context: &Context, next: impl Future<Output = T>) -> Result<T, RequestError> {
    let idle = context.config.upload.idle;
    let came = tokio::time::timeout(idle, next).await;
    came.map_err(|_| {
        let message = format!("nothing arrived for {} seconds", idle.as_secs_f64());
        RequestError::Stream(Status::deadline_exceeded(message))
    })
}

/// How much of a file has arrived.
struct Received {
    /// Offset of the next byte to arrive.
    next: u64,
    /// Bytes of the whole file.
    end: u64,
}

struct Receiver {
    /// `uploads/{id}`.
    name: String,
    files: HashMap<String, Received>,
    batch: Batch,
    /// Number of pieces, without those of the batch.
    pieces: u64,
    committer: Committer,
    part_bytes: u64,
    /// Received bytes of all files, including those not yet committed.
    bytes: u64,
}

impl Receiver {
    async fn take_all<S>(
        &mut self,
        context: &Context,
        lock: &UploadLock,
        chunks: &mut S,
    ) -> Result<(), RequestError>
    where
        S: Stream<Item = Result<WriteUploadRequest, Status>> + Unpin,
    {
        loop {
            let next = tokio::select! {
                biased;
                () = context.stop.cancelled() => return Err(RequestError::ShuttingDown),
                () = lock.wanted() => {
                    let id = Collection::Uploads.parse(&self.name).unwrap_or_default();
                    return Err(StoreError::taken_over(id).into());
                }
                next = within(context, chunks.next()) => next?,
            };
            match next {
                None => return Ok(()),
                Some(Err(status)) => return Err(RequestError::Stream(status)),
                Some(Ok(chunk)) => self.take(chunk).await?,
            }
        }
    }

    /// Checks a chunk, and starts a commit if the batch is full with it.
    async fn take(&mut self, message: WriteUploadRequest) -> Result<(), RequestError> {
        let WriteUploadRequest {
            upload,
            path,
            offset,
            chunk,
            crc32c: told,
        } = message;
        let shown: String = path.chars().take(80).collect();
        if !upload.is_empty() && upload != self.name {
            let message = format!("one stream writes to one upload, {}", self.name);
            return Err(RequestError::invalid("upload", message));
        }
        let Some(file_state) = self.files.get_mut(&path) else {
            let message = format!("{shown}: no file of {}", self.name);
            return Err(RequestError::invalid("path", message));
        };
        let found = crc32c(&chunk);
        if found != told {
            return Err(RequestError::CorruptChunk {
                path: shown,
                offset,
                told,
                found,
            });
        }
        if offset != file_state.next {
            let message = format!("{shown}: byte {} is next, not {offset}", file_state.next);
            return Err(RequestError::precondition(
                ErrorReason::UploadOffset,
                message,
            ));
        }
        let length = chunk.len() as u64;
        if length > file_state.end - file_state.next {
            let message = format!(
                "{shown}: {length} bytes at {offset}, but {} bytes in all were announced",
                file_state.end
            );
            return Err(RequestError::invalid("chunk", message));
        }
        if length == 0 {
            return Ok(());
        }
        if self.pieces + self.batch.pieces() >= UPLOAD_PIECES {
            let message = format!(
                "{shown}: the upload has {UPLOAD_PIECES} pieces, which is the most: write each file to its end before \
                 the next one"
            );
            return Err(RequestError::invalid("path", message));
        }
        file_state.next += length;
        self.bytes += length;
        let (mut chunk, mut offset) = (chunk, offset);
        while !chunk.is_empty() {
            let taken = self.batch.push(&path, offset, &chunk, self.part_bytes);
            chunk.advance(taken as usize);
            offset += taken;
            if self.batch.is_full(self.part_bytes) {
                self.commit().await?;
            }
        }
        Ok(())
    }

    /// Starts to commit the batch.
    async fn commit(&mut self) -> Result<(), RequestError> {
        let batch = std::mem::take(&mut self.batch);
        self.pieces += batch.pieces();
        self.committer.start(batch).await
    }

    /// Commits all that has arrived.
    async fn end(&mut self) -> Result<(), RequestError> {
        self.commit().await?;
        self.committer.wait().await
    }
}
