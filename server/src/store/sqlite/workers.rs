//! Workers and what they can run.

use super::rows::{Columns, During};
use crate::store::{NewWorker, StoreError, new_id};
use sqlx::{SqliteConnection, sqlite::SqliteRow};
use yoto_proto::{
    names::Collection,
    v1::{WorkerDevice, WorkerStatus},
};

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

/// The workers with `ids`, and those with a RUNNING job, oldest first.
pub async fn list(
    conn: &mut SqliteConnection,
    ids: &[&str],
    lease_seconds: f64,
) -> Result<Vec<WorkerStatus>, StoreError> {
    // Ids are hex digits and dashes: a space separates them.
    let ids = format!(" {} ", ids.join(" "));
    let rows = sqlx::query(
        "SELECT w.*, j.id AS job, j.lease_deadline - ?2 AS reported,
             (SELECT group_concat(kind, ' ' ORDER BY kind) FROM worker_kinds
              WHERE worker = w.id) AS kinds
         FROM workers w LEFT JOIN jobs j ON j.worker = w.id AND j.state = 'RUNNING'
         WHERE j.id IS NOT NULL OR instr(?1, ' ' || w.id || ' ') > 0
         ORDER BY w.ord",
    )
    .bind(ids)
    .bind(lease_seconds)
    .fetch_all(conn)
    .await
    .during("listing workers")?;
    rows.iter().map(read).collect()
}

fn read(row: &SqliteRow) -> Result<WorkerStatus, StoreError> {
    let kinds = row.maybe_text("kinds")?.unwrap_or_default();
    let job = row.maybe_text("job")?;
    Ok(WorkerStatus {
        name: Collection::Workers.name(&row.text("id")?),
        display_name: row.text("display_name")?,
        device: Some(WorkerDevice {
            backend: row.text("backend")?,
            adapter: row.text("adapter")?,
            gpu: row.flag("gpu")?,
            memory_bytes: row.number("memory_bytes")?,
        }),
        kinds: kinds.split(' ').map(str::to_owned).collect(),
        last_seen: row.time("reported")?,
        job: job.map_or_else(String::new, |id| Collection::Jobs.name(&id)),
    })
}
