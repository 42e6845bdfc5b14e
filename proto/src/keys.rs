//! Where objects stand in the store.
//!
//! Everything a worker writes has its job and fencing token in the key, so that a worker
//! that lost its lease can't overwrite what its successor wrote. The database row that
//! names a key is the commit point; an object no row names is garbage.

/// An uploaded file of a capture: `uploads/{capture}/{path}`.
pub fn upload(capture_id: &str, path: &str) -> String {
    format!("uploads/{capture_id}/{path}")
}

/// The training shard of a capture.
pub fn shard(capture_id: &str, job_id: &str, token: u64) -> String {
    format!("captures/{capture_id}/{job_id}-{token}/shard.bin")
}

/// The report of the check that ingest made of a capture.
pub fn check(capture_id: &str, job_id: &str, token: u64) -> String {
    format!("captures/{capture_id}/{job_id}-{token}/check.json")
}

/// The folder of one checkpoint.
pub fn checkpoint(model_id: &str, job_id: &str, token: u64, step: u64) -> String {
    format!("models/{model_id}/{job_id}-{token}/{step:09}")
}

/// The trade-off that an evaluate job measured of a checkpoint.
pub fn tradeoff(model_id: &str, job_id: &str, token: u64, step: u64) -> String {
    format!(
        "{}/tradeoff.json",
        checkpoint(model_id, job_id, token, step)
    )
}

/// A file that a render job made.
pub fn render(job_id: &str, token: u64, file: &str) -> String {
    format!("renders/{job_id}/{token}/{file}")
}
