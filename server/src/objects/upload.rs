//! Uploaded files as objects.

use crate::store::UploadedFile;
use yoto_proto::keys;
use yoto_proto::v1::ObjectRef;
use yoto_proto::worker::v1::InputFile;

/// An uploaded file as the ingest job gets it.
pub fn input_file(capture_id: &str, file: &UploadedFile) -> InputFile {
    InputFile {
        path: file.path.clone(),
        object: Some(ObjectRef {
            key: keys::upload(capture_id, &file.path),
            bytes: file.bytes,
            sha256: file.sha256.clone(),
        }),
    }
}

/// Whether `text` is a SHA-256 in the contract's form.
pub fn is_sha256(text: &str) -> bool {
    text.len() == 64 && text.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f'))
}
