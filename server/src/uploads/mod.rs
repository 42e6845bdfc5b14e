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
    Err(RequestError::precondition("UPLOAD_FINISHED", message))
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
