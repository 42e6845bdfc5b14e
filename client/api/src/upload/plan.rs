//! What an upload has not committed yet, cut into parts.

use super::source::Reader;
use super::{UploadFile, committed};
use crate::ClientError;
use bytes::Bytes;
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::iter::Zip;
use std::slice::Iter;
use yoto_proto::hex;
use yoto_proto::limits::{CHUNK_BYTES, LEAST_PART, PART_FILES};
use yoto_proto::v1::{FileHeader, PartPiece, Upload};

/// Bytes that become one object.
#[derive(Debug)]
pub(super) struct Part {
    pub(super) chunks: Vec<Bytes>,
    pub(super) pieces: Vec<PartPiece>,
    pub(super) bytes: u64,
    pub(super) sha256: String,
}

/// The parts of an upload that are still to come, read one by one.
pub(super) struct Plan<'a> {
    files: Zip<Iter<'a, UploadFile>, Iter<'a, FileHeader>>,
    committed: HashMap<&'a str, u64>,
    part_bytes: u64,
    open: Option<Open<'a>>,
}

/// The file that is read.
struct Open<'a> {
    path: &'a str,
    /// Offset of its next byte.
    offset: u64,
    /// Its size.
    end: u64,
    reader: Reader<'a>,
    /// What was read and is in no part yet.
    ahead: Bytes,
}

impl<'a> Plan<'a> {
    pub(super) fn new(
        upload: &'a Upload,
        files: &'a [UploadFile],
        headers: &'a [FileHeader],
    ) -> Self {
        Self {
            files: files.iter().zip(headers),
            committed: committed(upload),
            part_bytes: upload.part_bytes,
            open: None,
        }
    }

    /// The next part. `None` if what comes next is smaller than a part may be: a stream takes the rest.
    ///
    /// # Errors
    /// [`ClientError::File`] when a file can't be read or has changed.
    pub(super) async fn next(&mut self) -> Result<Option<Part>, ClientError> {
        let (mut chunks, mut pieces) = (Vec::new(), Vec::<PartPiece>::new());
        let (mut bytes, mut hash) = (0, Sha256::new());
        while bytes < self.part_bytes {
            let Some((path, offset, chunk)) = self.take(self.part_bytes - bytes).await? else {
                break;
            };
            let length = chunk.len() as u64;
            match pieces.last_mut() {
                Some(piece) if piece.path == path => piece.bytes += length,
                _ => pieces.push(PartPiece {
                    path: path.to_owned(),
                    offset,
                    bytes: length,
                }),
            }
            hash.update(&chunk);
            chunks.push(chunk);
            bytes += length;
            if pieces.len() == PART_FILES && self.open.is_none() {
                break;
            }
        }
        let sha256 = hex(&hash.finalize());
        let least = (self.part_bytes / LEAST_PART).max(1);
        Ok((bytes >= least).then_some(Part {
            chunks,
            pieces,
            bytes,
            sha256,
        }))
    }

    /// Path, offset and bytes of what comes next, at most `room` bytes of one file. `None` after the last file.
    async fn take(&mut self, room: u64) -> Result<Option<(&'a str, u64, Bytes)>, ClientError> {
        loop {
            if self.open.is_none() {
                self.open = self.next_file().await?;
            }
            let Some(open) = &mut self.open else {
                return Ok(None);
            };
            if open.ahead.is_empty() {
                match open.reader.next().await? {
                    Some(chunk) => open.ahead = Bytes::from(chunk),
                    None => {
                        self.open = None;
                        continue;
                    }
                }
            }
            let length = usize::try_from(room)
                .unwrap_or(usize::MAX)
                .min(open.ahead.len());
            let chunk = open.ahead.split_to(length);
            let (path, offset) = (open.path, open.offset);
            open.offset += length as u64;
            if open.offset == open.end {
                self.open = None;
            }
            return Ok(Some((path, offset, chunk)));
        }
    }

    /// The next file that is not committed to its end.
    async fn next_file(&mut self) -> Result<Option<Open<'a>>, ClientError> {
        for (file, header) in self.files.by_ref() {
            let offset = self.committed.get(&*file.path).copied().unwrap_or(0);
            if offset < header.bytes {
                let chunk = CHUNK_BYTES as u64;
                return Ok(Some(Open {
                    path: &file.path,
                    offset,
                    end: header.bytes,
                    reader: file.source.read_from(offset, header.bytes, chunk).await?,
                    ahead: Bytes::new(),
                }));
            }
        }
        Ok(None)
    }
}
