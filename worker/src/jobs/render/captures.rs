//! Downloads the captures that a plan reads.

use super::models::Models;
use crate::jobs::{JobContext, JobFailure, shard};
use yoto_film::{Capture, CaptureNeed, Captures};
use yoto_proto::worker::v1::Inputs;

/// The captures of `needs`, each with the poses that its model was taught. Shards are downloaded whole; pictures
/// stay in memory only if the plan needs them.
pub(super) fn fetch(
    context: &JobContext,
    inputs: &Inputs,
    models: &Models<'_>,
    needs: &[CaptureNeed<'_>],
) -> Result<Captures, JobFailure> {
    let mut captures = Captures::default();
    for need in needs {
        let downloaded = &models.named(need.model).downloaded;
        let (_, shard) = shard::with_refined_poses(context, inputs, downloaded, need.subject)?;
        let capture = match need.pictures {
            true => Capture::Shard(shard),
            false => Capture::Track(shard.track.clone()),
        };
        captures.insert(need.model, need.subject, capture);
    }
    Ok(captures)
}
