//! Uploads of captures: announced, written in parts that are committed one by one, and finished. The bytes come as a stream,
//! or the client puts parts into the object store by itself.
//!
//! A byte is acknowledged once its part is in the object store and the row of its file counts it. Whatever breaks (the
//! connection, the client, this process), the upload continues from there. Content is not read here: a capture
//! that arrives complete but is faulty becomes REJECTED by its ingest job, so that its owner sees the faults.

mod again;
mod announce;
mod batch;
mod finish;
mod locks;
mod parts;
mod paths;
mod verify;
mod write;

pub(crate) use again::ingest_again;
pub(crate) use announce::{create, describe, validate};
pub(crate) use finish::finish;
use locks::UploadLock;
pub(crate) use locks::UploadLocks;
pub(crate) use parts::{commit_part, sign_parts};
pub(crate) use write::receive;

use crate::context::Context;
use std::collections::BTreeSet;
use yoto_proto::v1::{Capture, ErrorReason};
use yoto_request::RequestError;
use yoto_store::{RequestKey, StoreError, Tenant, Upload};

/// Restarts the files at `paths`, whose acknowledged bytes the store has lost, and returns the error for the call that found
/// this. Otherwise each later write would fail until the upload expires.
async fn lost(
    context: &Context,
    tenant: &Tenant,
    id: &str,
    writer: u64,
    paths: BTreeSet<String>,
) -> RequestError {
    let paths: Vec<String> = paths.into_iter().collect();
    tracing::error!(
        upload = id,
        ?paths,
        "acknowledged bytes of an upload are lost"
    );
    let store = &context.store;
    if let Err(error) = store.restart_files(tenant, id, writer, &paths).await {
        return error.into();
    }
    let first = paths.first().map_or("", String::as_str);
    let others = match paths.len() {
        0 | 1 => String::new(),
        count => format!(", and of {} more", count - 1),
    };
    let message = format!(
        "{first}: the service has lost bytes of it{others}; what is missing has to be sent again"
    );
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
    Err(StoreError::upload_finished(id).into())
}

/// The state of an upload; with `stop_writer`, after the current writer has stopped.
///
/// # Errors
/// When there is none.
pub(crate) async fn get(
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
