//! The files that a job has written, as its result tells them.

use yoto_proto::v1::{Job, ObjectRef, job_result};

/// File of a measured trade-off.
pub const TRADEOFF: &str = "tradeoff.json";

/// The files in the result of a job by name, in the order in which it wrote them; none without a result. A training has its
/// files in the checkpoint that the result names, and those of an ingested capture stay with the service.
pub fn files_of_result(job: &Job) -> Vec<(String, ObjectRef)> {
    let result = job.result.as_ref().and_then(|result| result.kind.as_ref());
    match result {
        Some(job_result::Kind::Render(render)) => {
            let files = render.files.iter();
            let files = files.filter_map(|it| Some((it.file.clone(), it.object.clone()?)));
            files.collect()
        }
        Some(job_result::Kind::Evaluate(evaluate)) => {
            let tradeoff = evaluate.tradeoff.iter();
            tradeoff
                .map(|it| (TRADEOFF.to_owned(), it.clone()))
                .collect()
        }
        Some(job_result::Kind::Export(export)) => {
            let files = export.files.iter();
            let files = files.filter_map(|it| Some((it.file.clone(), it.object.clone()?)));
            files.collect()
        }
        Some(job_result::Kind::Train(_) | job_result::Kind::Ingest(_)) | None => Vec::new(),
    }
}
