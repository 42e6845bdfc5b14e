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
pub use announce::{create, describe, validate};
pub use finish::finish;
use locks::UploadLock;
pub use locks::UploadLocks;
pub use write::receive;

use crate::context::Context;
use crate::error::RequestError;
use crate::store::{RequestKey, Upload};
use crate::tenant::Tenant;
use yoto_proto::v1::{Capture, ErrorReason};

/// Restarts a file of an upload of which only `left` acknowledged bytes are still on disk, and returns the error for
/// the call that found this. Otherwise each later write would fail until the upload expires.
async fn lost(
    context: &Context,
    tenant: &Tenant,
    id: &str,
    writer: u64,
    path: &str,
    left: u64,
) -> RequestError {
    tracing::error!(
        upload = id,
        path,
        left,
        "acknowledged bytes of an upload are lost"
    );
    if let Err(error) = context.store.restart_file(tenant, id, writer, path).await {
        return error.into();
    }
    let message =
        format!("{path}: only {left} bytes are left of it; the file has to be sent again");
    RequestError::precondition(ErrorReason::UploadIncomplete, message)
}

/// Takes over an upload: calls of this process that write to it stop after they have committed what has arrived, and those
/// of other coordinators commit nothing more. Returns the lock of this process, and the number of the new writer. Only calls
/// of the upload's tenant stop others.
///
/// # Errors
/// When there is no such upload.
async fn take_over(
    context: &Context,
    tenant: &Tenant,
    id: &str,
) -> Result<(UploadLock, u64), RequestError> {
    context.store.require_upload(tenant, id).await?;
    let lock = context.upload_locks.acquire(id).await;
    let writer = context.store.take_over_upload(tenant, id).await?;
    Ok((lock, writer))
}

/// The capture in the earlier answer to the same request, if there was one. Comes before every check.
async fn answered(
    context: &Context,
    tenant: &Tenant,
    request: Option<&RequestKey>,
) -> Result<Option<Capture>, RequestError> {
    match context.store.answered(tenant, request).await? {
        Some(id) => Ok(Some(context.store.capture(tenant, &id).await?)),
        None => Ok(None),
    }
}

/// The open upload with this id.
///
/// # Errors
/// When there is none, or it is finished.
async fn open(context: &Context, tenant: &Tenant, id: &str) -> Result<Upload, RequestError> {
    let upload = context.store.upload(tenant, id).await?;
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
pub async fn get(
    context: &Context,
    tenant: &Tenant,
    id: &str,
    stop_writer: bool,
) -> Result<Upload, RequestError> {
    let _lock = match stop_writer {
        true => Some(take_over(context, tenant, id).await?),
        false => None,
    };
    Ok(context.store.upload(tenant, id).await?)
}
