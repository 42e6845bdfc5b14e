//! The end of an upload: its files are compared with what was announced, and its ingest job is queued.

use super::verify::{Faults, verify};
use super::{answered, lost, take_over};
use crate::context::Context;
use yoto_proto::v1::{Capture, ErrorReason};
use yoto_request::RequestError;
use yoto_request::validation::all;
use yoto_store::{JobKind, RequestKey, Tenant, UploadFile};

/// Checks the SHA-256 of every file in the store, and queues the ingest job. A finished upload gets the first answer
/// again.
///
/// # Errors
/// When bytes are missing, or a file differs from the announced one; that file has to be sent again. Its field is
/// `files["PATH"]`: the order in which the files were announced is not kept.
pub(crate) async fn finish(
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
        let parts = context.store.upload_parts(tenant, id).await?;
        let faults = verify(context, &upload.files, &parts).await?;
        refuse(context, tenant, id, writer, faults).await?;
    }
    let finished = context.store.finish_upload(tenant, id, writer, request);
    let capture = finished.await?;
    context.notifier.queued(tenant, JobKind::Ingest);
    let (name, job) = (&capture.name, &capture.ingest_job);
    tracing::info!(capture = name, job, "capture uploaded");
    Ok(capture)
}

/// Restarts the files with faults, and refuses the upload if there are any.
async fn refuse(
    context: &Context,
    tenant: &Tenant,
    id: &str,
    writer: u64,
    faults: Faults,
) -> Result<(), RequestError> {
    let Faults {
        lost: gone, others, ..
    } = faults;
    let paths: Vec<String> = others.iter().map(|(path, ..)| path.clone()).collect();
    if !paths.is_empty() {
        (context.store)
            .restart_files(tenant, id, writer, &paths)
            .await?;
    }
    if !gone.is_empty() {
        return Err(lost(context, tenant, id, writer, gone).await);
    }
    all::<()>(others.into_iter().map(|(path, announced, found)| {
        let message = format!(
            "{path}: the received bytes have {found}, not {announced}; the file has to be sent again"
        );
        let field = format!("files[\"{path}\"].sha256");
        Err(RequestError::invalid(field, message))
    }))
    .map(drop)
}
