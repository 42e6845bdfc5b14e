//! Captures in the form that clients send.

use yoto_proto::{
    sha256_hex,
    v1::{CaptureHeader, FileHeader, UploadCaptureRequest, upload_capture_request::Part},
};

/// A file of an upload: path, bytes, and the checksum to announce.
pub struct File {
    pub path: String,
    pub bytes: Vec<u8>,
    pub sha256: String,
}

pub fn file(path: &str, bytes: &[u8]) -> File {
    File {
        path: path.into(),
        bytes: bytes.into(),
        sha256: sha256_hex(bytes),
    }
}

/// The messages of an upload.
pub fn parts(subject: &str, files: Vec<File>) -> Vec<UploadCaptureRequest> {
    let mut parts = vec![Part::Header(CaptureHeader {
        subject: subject.into(),
    })];
    for File {
        path,
        bytes,
        sha256,
    } in files
    {
        parts.push(Part::File(FileHeader {
            path,
            bytes: bytes.len() as u64,
            sha256,
        }));
        parts.extend(
            bytes
                .chunks(7.max(bytes.len() / 64))
                .map(|chunk| Part::Chunk(chunk.to_vec())),
        );
    }
    parts
        .into_iter()
        .map(|part| UploadCaptureRequest { part: Some(part) })
        .collect()
}
