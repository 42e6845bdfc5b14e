//! Workers and what they can run.

use super::rows::During;
use crate::store::{NewWorker, StoreError, new_id};
use sqlx::SqliteConnection;

/// Adds a worker.
pub async fn register(conn: &mut SqliteConnection, new: NewWorker) -> Result<String, StoreError> {
    let id = new_id();
    // A device with more memory than fits into the column does not exist.
    let memory = i64::try_from(new.device.memory_bytes).unwrap_or(i64::MAX);
    sqlx::query(
        "INSERT INTO workers (id, display_name, backend, adapter, gpu, memory_bytes)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6)",
    )
    .bind(&id)
    .bind(&new.display_name)
    .bind(&new.device.backend)
    .bind(&new.device.adapter)
    .bind(new.device.gpu)
    .bind(memory)
    .execute(&mut *conn)
    .await
    .during("registering a worker")?;
    for kind in new.kinds {
        sqlx::query("INSERT OR IGNORE INTO worker_kinds (worker, kind) VALUES (?1, ?2)")
            .bind(&id)
            .bind(kind.as_str())
            .execute(&mut *conn)
            .await
            .during("recording what a worker runs")?;
    }
    Ok(id)
}
