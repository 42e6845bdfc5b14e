//! Keys of objects in the store.
//!
//! Everything a worker writes has its job and fencing token in the key, so that a worker
//! that lost its lease can't overwrite what its successor wrote. The database row that
//! names a key is the commit point; an object without a row is garbage.

/// An uploaded file of a capture: `uploads/{capture}/{path}`.
pub fn upload(capture_id: &str, path: &str) -> String {
    format!("uploads/{capture_id}/{path}")
}

/// The training shard of a capture.
pub fn shard(capture_id: &str, job_id: &str, token: u64) -> String {
    format!("captures/{capture_id}/{job_id}-{token}/shard.bin")
}

/// The report of a capture's check at ingest.
pub fn check(capture_id: &str, job_id: &str, token: u64) -> String {
    format!("captures/{capture_id}/{job_id}-{token}/check.json")
}

/// The folder of one checkpoint.
pub fn checkpoint(model_id: &str, job_id: &str, token: u64, step: u64) -> String {
    format!("models/{model_id}/{job_id}-{token}/{step:09}")
}

/// The trade-off of a checkpoint, measured by an evaluate job.
pub fn tradeoff(model_id: &str, job_id: &str, token: u64, step: u64) -> String {
    format!(
        "{}/tradeoff.json",
        checkpoint(model_id, job_id, token, step)
    )
}

/// A file of a render job.
pub fn render(job_id: &str, token: u64, file: &str) -> String {
    format!("renders/{job_id}/{token}/{file}")
}
