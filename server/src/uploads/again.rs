//! Another attempt to ingest an upload: a fault of the machine must not cost the user a second upload.

use super::answered;
use crate::context::Context;
use yoto_proto::v1::{Capture, capture};
use yoto_request::RequestError;
use yoto_store::{JobKind, RequestKey, StoreError, StoredPart, Tenant};

/// Queues another ingest job for a capture whose last one failed.
///
/// # Errors
/// When the capture is in another state, or its files are gone.
pub(crate) async fn ingest_again(
    context: &Context,
    tenant: &Tenant,
    id: &str,
    request: Option<RequestKey>,
) -> Result<Capture, RequestError> {
    if let Some(done) = answered(context, tenant, request.as_ref()).await? {
        return Ok(done);
    }
    let capture = context.store.capture(tenant, id).await?;
    // The store refuses the other states, and files that a collection of garbage removes at the same time.
    if matches!(
        capture.state(),
        capture::State::Uploaded | capture::State::Rejected
    ) {
        for StoredPart { part, .. } in context.store.upload_parts(tenant, id).await? {
            match context.objects.require(&part.object).await {
                Err(error) if error.is_torn() => {
                    let path = part.pieces.first().map(|piece| &piece.file);
                    tracing::error!(
                        capture = capture.name,
                        path,
                        %error,
                        "a file of an upload is lost"
                    );
                    return Err(StoreError::upload_gone(id).into());
                }
                required => required?,
            }
        }
    }
    let capture = context.store.ingest_capture(tenant, id, request).await?;
    context.notifier.queued(tenant, JobKind::Ingest);
    let (name, job) = (&capture.name, &capture.ingest_job);
    tracing::info!(capture = name, job, "capture is read again");
    Ok(capture)
}
