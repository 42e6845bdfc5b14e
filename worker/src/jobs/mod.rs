//! The jobs: one file per kind. A job is a plain function from a lease to a
//! result or a [`JobFailure`]; it asks [`JobContext::check`] often enough to stop within
//! a second, and reports progress instead of printing.

pub(crate) mod checkpoint;
mod context;
pub mod evaluate;
pub mod export;
mod failure;
pub mod ingest;
mod pace;
pub mod render;
pub(crate) mod shard;
#[cfg(test)]
pub(crate) mod test_context;
pub mod train;

pub use context::JobContext;
pub use failure::JobFailure;

use yoto_proto::v1::{JobResult, job_result, job_spec};
use yoto_proto::worker::v1::Lease;

/// Runs the leased job to its end on the calling thread.
///
/// # Errors
/// The reason why the job ended without a result.
pub fn run(context: &JobContext, lease: &Lease) -> Result<JobResult, JobFailure> {
    let spec = lease
        .job
        .as_ref()
        .and_then(|job| job.spec.as_ref())
        .and_then(|spec| spec.kind.as_ref());
    let inputs = lease.inputs.clone().unwrap_or_default();
    let kind = match spec {
        Some(job_spec::Kind::Ingest(spec)) => {
            job_result::Kind::Ingest(ingest::run(context, spec, &inputs)?)
        }
        Some(job_spec::Kind::Train(spec)) => {
            job_result::Kind::Train(train::run(context, spec, &inputs)?)
        }
        Some(job_spec::Kind::Render(spec)) => {
            job_result::Kind::Render(render::run(context, spec, &inputs, lease.helps)?)
        }
        Some(job_spec::Kind::Evaluate(spec)) => {
            job_result::Kind::Evaluate(evaluate::run(context, spec, &inputs)?)
        }
        Some(job_spec::Kind::Export(spec)) => {
            job_result::Kind::Export(export::run(context, spec, &inputs)?)
        }
        None => {
            return Err(JobFailure::invalid(
                "job",
                "spec",
                "this worker does not know the kind of this job",
            ));
        }
    };
    Ok(JobResult { kind: Some(kind) })
}
