//! Uploads of captures: announced, written in parts that are committed one by one, and finished.
//!
//! A byte is acknowledged once it is on disk and the row of its file counts it. Whatever breaks (the
//! connection, the client, this process), the upload continues from there. Content is not read here: a capture
//! that arrives complete but is faulty becomes REJECTED by its ingest job, so that its owner sees the faults.

mod again;
mod announce;
mod batch;
mod finish;
mod locks;
mod paths;
mod write;

pub use again::ingest_again;
pub use announce::{create, describe};
pub use finish::finish;
pub use locks::UploadLocks;
pub use write::receive;

use crate::context::Context;
use crate::error::RequestError;
use crate::store::Upload;
use yoto_proto::v1::ErrorReason;

/// Restarts a file of an upload of which only `left` acknowledged bytes are still on disk, and returns the error for
/// the call that found this. Otherwise each later write would fail until the upload expires.
async fn lost(context: &Context, id: &str, path: &str, left: u64) -> RequestError {
    tracing::error!(
        upload = id,
        path,
        left,
        "acknowledged bytes of an upload are lost"
    );
    if let Err(error) = context.store.restart_file(id, path).await {
        return error.into();
    }
    let message =
        format!("{path}: only {left} bytes are left of it; the file has to be sent again");
    RequestError::precondition(ErrorReason::UploadIncomplete, message)
}

/// The open upload with this id.
///
/// # Errors
/// When there is none, or it is finished.
async fn open(context: &Context, id: &str) -> Result<Upload, RequestError> {
    let upload = context.store.upload(id).await?;
    if upload.open {
        return Ok(upload);
    }
    let message = format!("uploads/{id} is finished");
    Err(RequestError::precondition(
        ErrorReason::UploadFinished,
        message,
    ))
}

/// The state of an upload; with `stop_writer`, after the current writer has stopped.
///
/// # Errors
/// When there is none.
pub async fn get(context: &Context, id: &str, stop_writer: bool) -> Result<Upload, RequestError> {
    let _lock = match stop_writer {
        true => Some(context.upload_locks.acquire(id).await),
        false => None,
    };
    Ok(context.store.upload(id).await?)
}
