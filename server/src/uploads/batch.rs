//! Chunks on their way into the store: a batch becomes a part, which is committed with its pieces.
//!
//! A part below [`limits::LEAST_PART`] is joined to the next one, whichever writer has committed it: its bytes come first in
//! the new part. So an upload has few objects, however often its connection breaks.

use super::lost;
use crate::context::Context;
use bytes::Bytes;
use std::sync::Arc;
use tokio::task::JoinHandle;
use yoto_proto::{keys, limits};
use yoto_request::RequestError;
use yoto_store::{NewPart, NewPiece, PartId, StoreError, Tenant, UploadPart};

/// Checked chunks that follow the committed bytes, grouped by file in the order of arrival.
#[derive(Debug, Default)]
pub(super) struct Batch {
    pieces: Vec<NewPiece>,
    chunks: Vec<Bytes>,
    bytes: u64,
}

impl Batch {
    /// Adds as much of a chunk at `offset` of a file, where the previous chunk of the file ended, as a part of `part_bytes`
    /// has room for. Returns the number of bytes.
    pub(super) fn push(&mut self, path: &str, offset: u64, chunk: &Bytes, part_bytes: u64) -> u64 {
        let room = part_bytes.saturating_sub(self.bytes);
        let length = room.min(chunk.len() as u64);
        let to = offset + length;
        self.bytes += length;
        self.chunks.push(chunk.slice(..length as usize));
        match self.pieces.last_mut() {
            Some(piece) if piece.path == path => piece.to = to,
            _ => self.pieces.push(NewPiece {
                path: path.to_owned(),
                from: offset,
                to,
            }),
        }
        length
    }

    /// Whether it is large enough to be committed.
    pub(super) fn is_full(&self, part_bytes: u64) -> bool {
        self.bytes >= part_bytes || self.pieces.len() >= limits::PART_FILES
    }

    /// Number of pieces of files.
    pub(super) fn pieces(&self) -> u64 {
        self.pieces.len() as u64
    }

    /// Whether there is nothing to commit.
    pub(super) fn is_empty(&self) -> bool {
        self.pieces.is_empty()
    }
}

/// A part that is joined to the next one.
#[derive(Debug)]
struct Tail {
    part: UploadPart,
    /// Its bytes, if this writer has written it.
    chunks: Option<Vec<Bytes>>,
}

impl Tail {
    /// Its bytes, from memory or the store.
    async fn read(&self, writer: &Writer) -> Result<Vec<Bytes>, RequestError> {
        if let Some(chunks) = &self.chunks {
            return Ok(chunks.clone());
        }
        let object = &self.part.object;
        let read = writer.context.objects.window(&object.key, 0..object.bytes);
        match read.await {
            Ok(bytes) => Ok(vec![bytes]),
            Err(error) if error.is_torn() => Err(writer.lost(self.part.id).await),
            Err(error) => Err(error.into()),
        }
    }
}

/// The newest writer of an upload.
#[derive(Clone)]
pub(super) struct Writer {
    /// The coordinator.
    pub context: Arc<Context>,
    /// Whose upload it is.
    pub tenant: Tenant,
    /// The upload's id.
    pub id: String,
    /// The writer's number.
    pub number: u64,
}

impl Writer {
    /// Writes `batch` after the `tail` as part `number`, then records it. Returns the part if it is to be joined to the next
    /// one.
    async fn commit(
        &self,
        batch: Batch,
        tail: Option<Tail>,
        number: u64,
    ) -> Result<Option<Tail>, RequestError> {
        let mut chunks = match &tail {
            Some(tail) => tail.read(self).await?,
            None => Vec::new(),
        };
        chunks.extend(batch.chunks);
        let id = PartId {
            writer: self.number,
            number,
        };
        if number == 0 {
            let folder = keys::upload_parts(&self.id);
            self.context.storage.place.make_private(&folder).await?;
        }
        let key = keys::upload_part(&self.id, id.writer, id.number);
        let object = self.context.objects.put_chunks(&key, &chunks).await?;
        let part = NewPart {
            id,
            object,
            pieces: batch.pieces,
            replaces: tail.as_ref().map(|it| it.part.id),
        };
        let store = &self.context.store;
        match store.commit_part(&self.tenant, &self.id, &part).await {
            Ok(()) => {}
            Err(error @ (StoreError::Rule { .. } | StoreError::NotFound { .. })) => {
                // No row names it, and none will.
                self.remove(&key).await;
                return Err(error.into());
            }
            // It may be recorded.
            Err(error) => return Err(error.into()),
        }
        if let Some(replaced) = &tail {
            self.remove(&replaced.part.object.key).await;
        }
        let part = UploadPart {
            id,
            object: part.object,
        };
        let is_small = is_small(&part, self.context.config.upload.part_bytes);
        Ok(is_small.then_some(Tail {
            part,
            chunks: Some(chunks),
        }))
    }

    /// Removes the object of a part that no row names; a collection removes it otherwise.
    async fn remove(&self, key: &str) {
        if let Err(error) = self.context.objects.delete(key).await {
            tracing::warn!(%error, "a part of an upload that nothing names is left");
        }
    }

    /// The error when the bytes of a part are lost, after the files with pieces in it have been restarted.
    async fn lost(&self, part: PartId) -> RequestError {
        let stored = (self.context.store)
            .upload_parts(&self.tenant, &self.id)
            .await;
        let stored = match stored {
            Ok(stored) => stored,
            Err(error) => return error.into(),
        };
        let pieces = stored.into_iter().filter(|it| it.id == part);
        let pieces = pieces.flat_map(|it| it.part.pieces);
        let files = pieces.map(|piece| piece.file).collect();
        lost(&self.context, &self.tenant, &self.id, self.number, files).await
    }
}

/// Whether a part is so small that it is joined to the next one.
fn is_small(part: &UploadPart, part_bytes: u64) -> bool {
    part.object.bytes < part_bytes / limits::LEAST_PART
}

/// What a commit leaves: its part, if that is joined to the next one.
type Committed = Result<Option<Tail>, RequestError>;

/// Commits one batch after another, while the next one arrives.
pub(super) struct Committer {
    writer: Writer,
    /// Number of the next part.
    next: u64,
    tail: Option<Tail>,
    running: Option<JoinHandle<Committed>>,
}

impl Committer {
    /// For the `writer` of an upload whose newest part is `newest`.
    pub(super) fn new(writer: Writer, newest: Option<UploadPart>) -> Self {
        let part_bytes = writer.context.config.upload.part_bytes;
        let small = newest.filter(|part| is_small(part, part_bytes));
        Self {
            writer,
            next: 0,
            tail: small.map(|part| Tail { part, chunks: None }),
            running: None,
        }
    }

    /// Starts to commit `batch` once the previous one is committed.
    ///
    /// # Errors
    /// When the previous commit failed; nothing is written after it.
    pub(super) async fn start(&mut self, batch: Batch) -> Result<(), RequestError> {
        self.wait().await?;
        if !batch.is_empty() {
            let (writer, number) = (self.writer.clone(), self.next);
            let tail = self.tail.take();
            self.next += 1;
            let work = async move { writer.commit(batch, tail, number).await };
            self.running = Some(tokio::spawn(work));
        }
        Ok(())
    }

    /// Waits until all is committed.
    ///
    /// # Errors
    /// When it could not be committed.
    pub(super) async fn wait(&mut self) -> Result<(), RequestError> {
        let Some(running) = self.running.take() else {
            return Ok(());
        };
        self.tail = running.await.unwrap_or_else(|error| {
            let id = &self.writer.id;
            tracing::error!(upload = id, %error, "a commit of an upload ended early");
            Err(RequestError::Stream(tonic::Status::internal(
                "a commit of the upload ended early",
            )))
        })?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chunk_is_divided_where_a_part_ends() {
        let mut batch = Batch::default();
        let chunk = Bytes::from_static(b"0123456789");
        assert_eq!(batch.push("a", 5, &chunk, 14), 10);
        assert!(!batch.is_full(14));
        assert_eq!(batch.push("b", 0, &chunk, 14), 4);
        assert!(batch.is_full(14));
        assert_eq!(batch.chunks.concat(), b"01234567890123");
        let piece = |path: &str, from, to| NewPiece {
            path: path.into(),
            from,
            to,
        };
        assert_eq!(batch.pieces, [piece("a", 5, 15), piece("b", 0, 4)]);
    }
}
