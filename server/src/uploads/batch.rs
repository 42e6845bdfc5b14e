//! Chunks on their way to the disk, and their commit.

use super::lost;
use crate::context::Context;
use crate::error::RequestError;
use crate::objects::disk;
use crate::objects::parts::Piece;
use crate::store::CommittedPart;
use crate::tenant::Tenant;
use bytes::Bytes;
use std::sync::Arc;
use tokio::task::JoinHandle;
use yoto_objects::ObjectsError;
use yoto_proto::{keys, limits};

/// Checked chunks that follow the committed bytes, grouped by file in the order of arrival.
#[derive(Debug, Default)]
pub struct Batch {
    parts: Vec<(CommittedPart, Vec<Bytes>)>,
    bytes: u64,
}

impl Batch {
    /// Adds a chunk at `offset` of a file, where the previous chunk of the file ended.
    pub fn push(&mut self, path: &str, offset: u64, chunk: Bytes) {
        self.bytes += chunk.len() as u64;
        let to = offset + chunk.len() as u64;
        match self.parts.last_mut() {
            Some((part, chunks)) if part.path == path => {
                part.to = to;
                chunks.push(chunk);
            }
            _ => {
                let part = CommittedPart {
                    path: path.to_owned(),
                    from: offset,
                    to,
                };
                self.parts.push((part, vec![chunk]));
            }
        }
    }

    /// Whether it is large enough to be committed.
    pub fn is_full(&self, part_bytes: u64) -> bool {
        self.bytes >= part_bytes || self.parts.len() >= limits::PART_FILES
    }

    /// Whether there is nothing to commit.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// Writes all chunks durably, then records them in the catalogue.
    async fn commit(
        self,
        context: &Context,
        tenant: &Tenant,
        id: &str,
        writer: u64,
    ) -> Result<(), RequestError> {
        let (parts, chunks): (Vec<_>, Vec<_>) = self.parts.into_iter().unzip();
        let pieces = parts.iter().zip(chunks).map(|(part, chunks)| Piece {
            key: keys::upload(id, &part.path),
            offset: part.from,
            chunks,
        });
        let written = (context.place.uploads())
            .write_pieces(pieces.collect())
            .await;
        if let Err(ObjectsError::Size { key, found, .. }) = &written
            && let Some(part) = parts.iter().find(|it| keys::upload(id, &it.path) == *key)
        {
            return Err(lost(context, tenant, id, writer, &part.path, *found).await);
        }
        written?;
        let recorded = context.store.commit_parts(tenant, id, writer, &parts);
        Ok(recorded.await?)
    }
}

/// Commits one batch after another, while the next one arrives.
pub struct Committer {
    context: Arc<Context>,
    tenant: Tenant,
    id: String,
    writer: u64,
    running: Option<JoinHandle<Result<(), RequestError>>>,
}

impl Committer {
    /// For the `writer` of the upload `id`.
    pub fn new(context: Arc<Context>, tenant: Tenant, id: &str, writer: u64) -> Self {
        Self {
            context,
            tenant,
            id: id.to_owned(),
            writer,
            running: None,
        }
    }

    /// Starts to commit `batch` once the previous one is committed.
    ///
    /// # Errors
    /// When the previous commit failed; nothing is written after it.
    pub async fn start(&mut self, batch: Batch) -> Result<(), RequestError> {
        self.wait().await?;
        if !batch.is_empty() {
            let (context, tenant) = (Arc::clone(&self.context), self.tenant.clone());
            let (id, writer) = (self.id.clone(), self.writer);
            let work = async move { batch.commit(&context, &tenant, &id, writer).await };
            self.running = Some(tokio::spawn(work));
        }
        Ok(())
    }

    /// Waits until all is committed.
    ///
    /// # Errors
    /// When it could not be committed.
    pub async fn wait(&mut self) -> Result<(), RequestError> {
        let Some(running) = self.running.take() else {
            return Ok(());
        };
        running.await.unwrap_or_else(|error| {
            let cause = std::io::Error::other(error);
            Err(disk::failed("writing", self.id.as_ref(), cause).into())
        })
    }
}
