//! The end of an upload: its files are compared with what was announced, and its ingest job is queued.

use super::{answered, lost, take_over};
use crate::context::Context;
use crate::error::RequestError;
use crate::store::{RequestKey, UploadFile};
use crate::tenant::Tenant;
use bytes::Bytes;
use futures::{StreamExt, TryStreamExt, stream};
use yoto_objects::ObjectsError;
use yoto_proto::keys;
use yoto_proto::v1::{Capture, ErrorReason};

/// Files that are hashed at once.
const HASHED_AT_ONCE: usize = 2;

/// Checks the SHA-256 of every file on disk, and queues the ingest job. A finished upload gets the first answer
/// again.
///
/// # Errors
/// When bytes are missing, or a file differs from the announced one; that file has to be sent again. Its field is
/// `files["PATH"]`: the order in which the files were announced is not kept.
pub async fn finish(
    context: &Context,
    tenant: &Tenant,
    id: &str,
    request: Option<RequestKey>,
) -> Result<Capture, RequestError> {
    if let Some(done) = answered(context, tenant, request.as_ref()).await? {
        return Ok(done);
    }
    let (_lock, writer) = take_over(context, tenant, id).await?;
    let upload = context.store.upload(tenant, id).await?;
    if upload.open {
        if let Some(file) = upload.files.iter().find(|file| file.committed < file.bytes) {
            let UploadFile {
                path,
                bytes,
                committed,
                ..
            } = file;
            let message = format!("{path}: {committed} of {bytes} bytes have arrived");
            return Err(RequestError::precondition(
                ErrorReason::UploadIncomplete,
                message,
            ));
        }
        stream::iter(upload.files)
            .map(|file| verify(context, tenant, id, writer, file))
            .buffer_unordered(HASHED_AT_ONCE)
            .try_collect::<()>()
            .await?;
    }
    let capture = context.store.finish_upload(tenant, id, request).await?;
    context.place.forget_upload(id).await;
    let (name, job) = (&capture.name, &capture.ingest_job);
    tracing::info!(capture = name, job, "capture uploaded");
    Ok(capture)
}

/// Compares a file with its announced checksum. An empty file is created, since no chunk of it arrives.
async fn verify(
    context: &Context,
    tenant: &Tenant,
    id: &str,
    writer: u64,
    file: UploadFile,
) -> Result<(), RequestError> {
    let key = keys::upload(id, &file.path);
    let hashed = match file.bytes {
        0 => Ok(context.objects.put(&key, Bytes::new()).await?.sha256),
        bytes => context.place.uploads().sha256(&key, bytes).await,
    };
    let found = match hashed {
        Err(ObjectsError::Size { found, .. }) => {
            return Err(lost(context, tenant, id, writer, &file.path, found).await);
        }
        hashed => hashed?,
    };
    if found == file.sha256 {
        if file.bytes > 0 {
            context.place.publish(&key, file.bytes).await?;
        }
        return Ok(());
    }
    (context.store)
        .restart_file(tenant, id, writer, &file.path)
        .await?;
    let message = format!(
        "{}: the received bytes have {found}, not {}; the file has to be sent again",
        file.path, file.sha256
    );
    let field = format!("files[\"{}\"].sha256", file.path);
    Err(RequestError::invalid(field, message))
}
