//! The picture behind a scene, which comes with the order: it is decoded in a child process, like an upload.

use crate::jobs::{JobContext, JobFailure};
use yoto_film::Plan;
use yoto_ingest::{IngestError, read_backdrop};
use yoto_proto::v1::RenderSpec;
use yoto_proto::v1::render_spec::What;

/// Adds the backdrop of the order, if it has one, to its plan.
///
/// # Errors
/// When it is no picture, or too large; faults of this machine.
pub(super) fn add(
    context: &JobContext,
    spec: &RenderSpec,
    plan: &mut Plan,
) -> Result<(), JobFailure> {
    let Some(What::Scene(scene)) = &spec.what else {
        return Ok(());
    };
    let Some(surroundings) = &mut plan.surroundings else {
        return Ok(());
    };
    if scene.backdrop.is_empty() {
        return Ok(());
    }
    let folder = context.folder().map_err(|error| {
        JobFailure::try_later("MACHINE", "making a folder for the backdrop", &error)
    })?;
    let read = read_backdrop(folder.path(), &scene.backdrop, &context.ingest, |_| {
        context.check()
    });
    let picture = read.map_err(|error| match error {
        // The order is at fault.
        IngestError::Rejected(found) => JobFailure::Invalid(found),
        other => other.into(),
    })?;
    surroundings.backdrop = Some(picture);
    Ok(())
}
