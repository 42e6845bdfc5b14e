//! Files to upload, on disk or in memory, read from any offset.

use crate::ClientError;
use sha2::{Digest, Sha256};
use std::io::{Error, ErrorKind, SeekFrom};
use std::path::{Path, PathBuf};
use tokio::io::{AsyncReadExt, AsyncSeekExt};
use yoto_proto::limits::CHUNK_BYTES;
use yoto_proto::v1::FileHeader;

/// Source of a file's content.
#[derive(Debug, Clone)]
pub enum FileSource {
    /// Read from disk while it is sent.
    Disk(PathBuf),
    /// Held in memory.
    Memory(Vec<u8>),
}

/// One file of a capture.
#[derive(Debug, Clone)]
pub struct UploadFile {
    /// Path inside the capture: "poses.json", "frames/000000.png".
    pub path: String,
    /// Its content.
    pub source: FileSource,
}

impl UploadFile {
    /// Its length.
    pub(super) async fn bytes(&self) -> Result<u64, ClientError> {
        match &self.source {
            FileSource::Disk(path) => {
                let found = tokio::fs::metadata(path).await;
                Ok(found.map_err(ClientError::file("reading", path))?.len())
            }
            FileSource::Memory(bytes) => Ok(bytes.len() as u64),
        }
    }

    /// What an upload announces of it.
    pub(super) async fn header(&self) -> Result<FileHeader, ClientError> {
        let (bytes, sha256) = match &self.source {
            FileSource::Disk(path) => measure(path).await?,
            FileSource::Memory(bytes) => (bytes.len() as u64, yoto_proto::sha256_hex(bytes)),
        };
        Ok(FileHeader {
            path: self.path.clone(),
            bytes,
            sha256,
        })
    }
}

impl FileSource {
    /// Reads the bytes from `start` to `end`, `chunk` at a time.
    pub(super) async fn read_from(
        &self,
        start: u64,
        end: u64,
        chunk: u64,
    ) -> Result<Reader<'_>, ClientError> {
        match self {
            Self::Disk(path) => {
                let mut reader = DiskReader::open(path).await?;
                let moved = reader.file.seek(SeekFrom::Start(start)).await;
                moved.map_err(ClientError::file("reading", path))?;
                reader.left = end.saturating_sub(start);
                reader.chunk = chunk;
                Ok(Reader::Disk(reader))
            }
            Self::Memory(bytes) => {
                let start = usize::try_from(start)
                    .unwrap_or(usize::MAX)
                    .min(bytes.len());
                Ok(Reader::Memory(&bytes[start..], chunk as usize))
            }
        }
    }
}

/// Chunks of a file.
#[derive(Debug)]
pub(super) enum Reader<'a> {
    Disk(DiskReader<'a>),
    /// What is left, and the length of a chunk.
    Memory(&'a [u8], usize),
}

impl Reader<'_> {
    /// The next bytes; `None` at the end.
    pub(super) async fn next(&mut self) -> Result<Option<Vec<u8>>, ClientError> {
        match self {
            Self::Disk(reader) => reader.next().await,
            Self::Memory(bytes, length) => {
                let (chunk, rest) = bytes.split_at(bytes.len().min(*length));
                *bytes = rest;
                Ok((!chunk.is_empty()).then(|| chunk.to_vec()))
            }
        }
    }
}

/// Size and SHA-256 of a file that may be larger than memory.
pub(crate) async fn measure(path: &Path) -> Result<(u64, String), ClientError> {
    let failed = || ClientError::file("reading", path);
    let mut reader = DiskReader::open(path).await?;
    let all = reader.file.metadata().await.map_err(failed())?.len();
    reader.left = all;
    let mut hash = Sha256::new();
    while let Some(chunk) = reader.next().await? {
        hash.update(&chunk);
    }
    Ok((all, yoto_proto::hex(&hash.finalize())))
}

/// A file on disk that is read up to an offset.
#[derive(Debug)]
pub(super) struct DiskReader<'a> {
    path: &'a Path,
    file: tokio::fs::File,
    left: u64,
    /// Bytes to read at once.
    chunk: u64,
}

impl<'a> DiskReader<'a> {
    async fn open(path: &'a Path) -> Result<Self, ClientError> {
        let file = tokio::fs::File::open(path).await;
        Ok(Self {
            path,
            file: file.map_err(ClientError::file("opening", path))?,
            left: 0,
            chunk: CHUNK_BYTES as u64,
        })
    }

    async fn next(&mut self) -> Result<Option<Vec<u8>>, ClientError> {
        let wanted = self.left.min(self.chunk);
        if wanted == 0 {
            return Ok(None);
        }
        let mut chunk = Vec::with_capacity(wanted as usize);
        let mut limited = (&mut self.file).take(wanted);
        let read = limited.read_to_end(&mut chunk).await;
        let failed = || ClientError::file("reading", self.path);
        read.map_err(failed())?;
        if (chunk.len() as u64) < wanted {
            let message = "it became shorter while it was uploaded";
            return Err(failed()(Error::new(ErrorKind::UnexpectedEof, message)));
        }
        self.left -= wanted;
        Ok(Some(chunk))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn on_disk(path: &Path) -> UploadFile {
        UploadFile {
            path: "poses.json".into(),
            source: FileSource::Disk(path.to_owned()),
        }
    }

    #[tokio::test]
    async fn a_missing_file_is_named() {
        let file = on_disk(Path::new("/nowhere/poses.json"));
        let error = file.header().await.expect_err("there is no such file");
        assert!(error.to_string().contains("/nowhere/poses.json"), "{error}");
    }

    #[tokio::test]
    async fn a_file_that_becomes_shorter_is_an_error() {
        let dir = tempfile::tempdir().expect("a temporary folder");
        let path = dir.path().join("poses.json");
        std::fs::write(&path, b"0123456789").expect("writes");
        let file = on_disk(&path);
        let header = file.header().await.expect("is measured");
        assert_eq!(
            (header.bytes, header.sha256),
            (10, yoto_proto::sha256_hex(b"0123456789"))
        );
        std::fs::write(&path, b"0123").expect("writes");
        let reader = file.source.read_from(2, 10, 99).await;
        let next = reader.expect("opens").next().await;
        let error = next.expect_err("6 bytes are missing");
        assert!(error.to_string().contains("poses.json"), "{error}");
    }
}
