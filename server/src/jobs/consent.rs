//! Ends jobs of people whose consent was revoked or has run out.

use crate::context::Context;
use yoto_store::StoreError;

/// Ends the open jobs that need the person `subject_id`, or anybody, and lack their consent. Returns the jobs, `jobs/{id}`.
///
/// # Errors
/// When the store fails. Jobs that have not ended are found again.
pub(crate) async fn stop(
    context: &Context,
    subject_id: Option<&str>,
) -> Result<Vec<String>, StoreError> {
    let stopped = context.store.stop_without_consent(subject_id).await?;
    let mut jobs = Vec::with_capacity(stopped.len());
    for it in stopped {
        context.notifier.announce_end(&it.job);
        tracing::info!(
            job = it.job,
            reason = it.reason,
            "a job has ended without consent"
        );
        jobs.push(it.job);
    }
    Ok(jobs)
}
