//! The files of a capture on this disk, as the service's client sends them.

use yoto_client::{FileSource, UploadFile};
use yoto_import::capture_dir::{self, CaptureFile};

/// `files` for an upload.
pub(crate) fn upload_files(files: Vec<CaptureFile>) -> Vec<UploadFile> {
    let file = |file: CaptureFile| UploadFile {
        path: file.path,
        source: match file.source {
            capture_dir::FileSource::Disk(path) => FileSource::Disk(path),
            capture_dir::FileSource::Memory(bytes) => FileSource::Memory(bytes),
        },
    };
    files.into_iter().map(file).collect()
}
