//! Captures in the form that clients send.

use yoto_proto::v1::{FileHeader, WriteUploadRequest};
use yoto_proto::{crc32c, sha256_hex};

/// A file of an upload: path, bytes, and the checksum to announce.
#[derive(Clone)]
pub(crate) struct File {
    pub path: String,
    pub bytes: Vec<u8>,
    pub sha256: String,
}

pub(crate) fn file(path: &str, bytes: &[u8]) -> File {
    File {
        path: path.into(),
        bytes: bytes.into(),
        sha256: sha256_hex(bytes),
    }
}

/// What an upload announces.
pub(crate) fn headers(files: &[File]) -> Vec<FileHeader> {
    let header = |file: &File| FileHeader {
        path: file.path.clone(),
        bytes: file.bytes.len() as u64,
        sha256: file.sha256.clone(),
    };
    files.iter().map(header).collect()
}

/// A message of an upload.
pub(crate) fn chunk(upload: &str, path: &str, offset: u64, bytes: &[u8]) -> WriteUploadRequest {
    WriteUploadRequest {
        upload: upload.into(),
        path: path.into(),
        offset,
        chunk: bytes.to_vec().into(),
        crc32c: crc32c(bytes),
    }
}

/// All messages of an upload; small files in chunks of 7 bytes.
pub(crate) fn chunks(upload: &str, files: &[File]) -> Vec<WriteUploadRequest> {
    let mut messages = Vec::new();
    for file in files {
        let mut offset = 0;
        for bytes in file.bytes.chunks(7.max(file.bytes.len() / 64)) {
            messages.push(chunk(upload, &file.path, offset, bytes));
            offset += bytes.len() as u64;
        }
    }
    messages
}
