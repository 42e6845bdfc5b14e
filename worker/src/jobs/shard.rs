//! Fetches the training shards of earlier ingest jobs.

use super::{JobContext, JobFailure};
use std::sync::Arc;
use yoto_capture::Shard;
use yoto_proto::v1::{Inputs, SubjectShard};

/// The shard of `subject`, with its display name.
pub(crate) fn fetch(
    context: &JobContext,
    inputs: &Inputs,
    subject: &str,
) -> Result<(String, Arc<Shard>), JobFailure> {
    let SubjectShard {
        display_name,
        shard,
        ..
    } = inputs
        .shards
        .iter()
        .find(|entry| entry.subject == subject)
        .ok_or_else(|| missing(subject))?;
    let object = shard.as_ref().ok_or_else(|| missing(subject))?;
    let bytes = context.get(object)??;
    let shard = Shard::from_bytes(Vec::from(bytes)).map_err(|error| {
        JobFailure::failed(
            "INTERNAL",
            &format!("the shard of {subject}, {}", object.key),
            &error,
        )
    })?;
    Ok((display_name.clone(), Arc::new(shard)))
}

fn missing(subject: &str) -> JobFailure {
    JobFailure::Failed {
        code: "NO_CAPTURE",
        message: format!("{subject} has no ingested capture"),
    }
}
