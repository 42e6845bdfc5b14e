//! Files of renders and exports, committed one by one.

use super::leases::{self, bound, held};
use super::rows::{Columns, During, integer};
use crate::store::{LeaseKey, StoreError};
use sqlx::SqliteConnection;
use yoto_proto::v1::RenderedFile;

/// Commits a file of a job that the worker runs, or of a render that it helps with. It replaces an earlier file
/// of the same name, which is damaged or from an earlier lease.
pub async fn commit(
    conn: &mut SqliteConnection,
    lease: &LeaseKey,
    file: &RenderedFile,
) -> Result<(), StoreError> {
    let object = file.object.clone().unwrap_or_default();
    let statement = held!(
        "UPDATE jobs SET sequence = sequence + 1",
        "AND kind IN ('render', 'export')"
    );
    let running = bound(statement, lease)?
        .execute(&mut *conn)
        .await
        .during("checking a lease")?;
    if running.rows_affected() == 0 {
        return Err(leases::refusal(conn, lease).await);
    }
    sqlx::query(
        "INSERT INTO job_outputs (job, file, key, bytes, sha256) VALUES (?1, ?2, ?3, ?4, ?5)
         ON CONFLICT (job, file) DO UPDATE SET key = ?3, bytes = ?4, sha256 = ?5",
    )
    .bind(&lease.job_id)
    .bind(&file.file)
    .bind(&object.key)
    .bind(integer("file.object.bytes", object.bytes)?)
    .bind(&object.sha256)
    .execute(conn)
    .await
    .during("committing a file")?;
    Ok(())
}

/// The committed files of a job, in the order of their commits.
pub async fn list(
    conn: &mut SqliteConnection,
    job_id: &str,
) -> Result<Vec<RenderedFile>, StoreError> {
    let rows = sqlx::query("SELECT * FROM job_outputs WHERE job = ?1 ORDER BY ord")
        .bind(job_id)
        .fetch_all(conn)
        .await
        .during("listing the files of a job")?;
    rows.iter()
        .map(|row| {
            Ok(RenderedFile {
                file: row.text("file")?,
                object: row.object("key", "bytes", "sha256")?,
            })
        })
        .collect()
}
