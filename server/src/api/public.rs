//! What users see of a job: keys of stored objects are the service's own. Files have names, sizes and checksums, and
//! ObjectService has their bytes.

use yoto_proto::v1::{Job, ObjectRef, job_result};

/// `job` without the keys of its objects.
pub(crate) fn job(mut job: Job) -> Job {
    let result = job.result.as_mut().and_then(|result| result.kind.as_mut());
    match result {
        Some(job_result::Kind::Ingest(it)) => {
            without_keys([&mut it.shard, &mut it.check, &mut it.thumbnail]);
        }
        Some(job_result::Kind::Render(it)) => {
            without_keys(it.files.iter_mut().map(|file| &mut file.object));
        }
        Some(job_result::Kind::Evaluate(it)) => without_keys([&mut it.tradeoff]),
        Some(job_result::Kind::Export(it)) => {
            without_keys(it.files.iter_mut().map(|file| &mut file.object));
        }
        Some(job_result::Kind::Train(_)) | None => {}
    }
    job
}

fn without_keys<'a>(objects: impl IntoIterator<Item = &'a mut Option<ObjectRef>>) {
    for object in objects.into_iter().flatten() {
        object.key.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use prost::Message;
    use yoto_proto::v1::{
        EvaluateResult, ExportResult, ExportedFile, IngestResult, JobResult, RenderResult,
        RenderedFile,
    };

    #[test]
    fn no_result_shows_a_key() {
        let object = || {
            Some(ObjectRef {
                key: "SECRET".into(),
                bytes: 3,
                sha256: "told".into(),
            })
        };
        let kinds = [
            job_result::Kind::Ingest(IngestResult {
                shard: object(),
                check: object(),
                thumbnail: object(),
                ..IngestResult::default()
            }),
            job_result::Kind::Render(RenderResult {
                files: vec![RenderedFile {
                    file: "a.png".into(),
                    object: object(),
                }],
                ..RenderResult::default()
            }),
            job_result::Kind::Evaluate(EvaluateResult {
                tradeoff: object(),
                ..EvaluateResult::default()
            }),
            job_result::Kind::Export(ExportResult {
                files: vec![ExportedFile {
                    object: object(),
                    ..ExportedFile::default()
                }],
                ..ExportResult::default()
            }),
        ];
        for kind in kinds {
            let shown = job(Job {
                result: Some(JobResult { kind: Some(kind) }),
                ..Job::default()
            });
            let bytes = shown.encode_to_vec();
            let has = |text: &[u8]| bytes.windows(text.len()).any(|it| it == text);
            assert!(has(b"told") && !has(b"SECRET"), "{shown:?}");
        }
    }
}
