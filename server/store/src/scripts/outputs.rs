//! Files of renders and exports, committed one by one.

use super::leases::{bound, held};
use super::usage;
use crate::db::{Row, Tx, integer, sql};
use crate::{LeaseKey, StoreError};
use yoto_proto::keys;
use yoto_proto::v1::RenderedFile;
use yoto_proto::worker::v1::PictureRange;

/// Commits a file of a job that the worker runs, or of a render that it helps with. It replaces an earlier file
/// of the same name, which is damaged or from an earlier lease.
pub(crate) async fn commit(
    tx: &mut Tx,
    lease: &LeaseKey,
    file: &RenderedFile,
) -> Result<(), StoreError> {
    let object = file.object.clone().unwrap_or_default();
    let statement = held!(
        "UPDATE jobs SET sequence = sequence + 1",
        "AND kind IN ('render', 'export')"
    );
    let running = bound(statement, lease)?
        .execute(tx, "checking a lease")
        .await?;
    if running == 0 {
        return Err(lease.stale());
    }
    sql(
        "INSERT INTO job_outputs (job, file, key, bytes, sha256) VALUES ($1, $2, $3, $4, $5)
         ON CONFLICT (job, file) DO UPDATE SET key = $3, bytes = $4, sha256 = $5",
    )
    .bind(&lease.job_id)
    .bind(&file.file)
    .bind(&object.key)
    .bind(integer("file.object.bytes", object.bytes)?)
    .bind(&object.sha256)
    .execute(tx, "committing a file")
    .await?;
    usage::picture(tx, &lease.job_id).await
}

/// The committed files of a job, in the order of their commits.
pub(crate) async fn list(tx: &mut Tx, job_id: &str) -> Result<Vec<RenderedFile>, StoreError> {
    let rows = sql("SELECT * FROM job_outputs WHERE job = $1 ORDER BY ord")
        .bind(job_id)
        .rows(tx, "listing the files of a job")
        .await?;
    rows.iter().map(read).collect()
}

/// The committed files of a range, ordered by name.
pub(crate) async fn between(
    tx: &mut Tx,
    job_id: &str,
    range: &PictureRange,
) -> Result<Vec<RenderedFile>, StoreError> {
    // The order of names is that of indices, because all have six digits.
    let last = range.first + range.count.saturating_sub(1);
    let rows = sql(
        "SELECT * FROM job_outputs WHERE job = $1 AND file BETWEEN $2 AND $3
             AND length(file) = length($2) ORDER BY file",
    )
    .bind(job_id)
    .bind(keys::picture(range.first))
    .bind(keys::picture(last))
    .rows(tx, "listing the files of a range")
    .await?;
    rows.iter().map(read).collect()
}

/// Number of committed files of a job.
pub(crate) async fn count(tx: &mut Tx, job_id: &str) -> Result<u32, StoreError> {
    sql("SELECT count(*) AS files FROM job_outputs WHERE job = $1")
        .bind(job_id)
        .one(tx, "counting the files of a job")
        .await?
        .number("files")
}

fn read(row: &Row) -> Result<RenderedFile, StoreError> {
    Ok(RenderedFile {
        file: row.text("file")?,
        object: row.object("key", "bytes", "sha256")?,
    })
}
