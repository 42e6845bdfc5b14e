//! Another attempt to ingest an upload: a fault of the machine must not cost the user a second upload.

use super::answered;
use crate::context::Context;
use crate::error::RequestError;
use crate::objects::upload::input_file;
use crate::store::{RequestKey, StoreError};
use crate::tenant::Tenant;
use yoto_proto::v1::{Capture, capture};

/// Queues another ingest job for a capture whose last one failed.
///
/// # Errors
/// When the capture is in another state, or its files are gone.
pub async fn ingest_again(
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
        for file in context.store.capture_files(tenant, id).await? {
            let object = input_file(id, &file).object.unwrap_or_default();
            match context.objects.require(&object).await {
                Err(error) if error.is_torn() => {
                    tracing::error!(
                        capture = capture.name,
                        path = file.path,
                        "a file of an upload is lost"
                    );
                    return Err(StoreError::upload_gone(id).into());
                }
                required => required?,
            }
        }
    }
    let capture = context.store.ingest_capture(tenant, id, request).await?;
    let (name, job) = (&capture.name, &capture.ingest_job);
    tracing::info!(capture = name, job, "capture is read again");
    Ok(capture)
}
