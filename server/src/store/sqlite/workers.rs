//! Workers and the kinds of jobs that they run.

use super::rows::{Columns, During};
use super::steps::age;
use crate::store::{Entry, JobKind, NewWorker, Page, StoreError, new_id};
use sqlx::SqliteConnection;
use sqlx::sqlite::SqliteRow;
use yoto_proto::names::Collection;
use yoto_proto::v1::{WorkerDevice, WorkerStatus};

/// Adds a worker.
pub async fn register(
    conn: &mut SqliteConnection,
    new: NewWorker,
    now: f64,
) -> Result<String, StoreError> {
    let id = new_id();
    // No device has more memory than fits into the column.
    let memory = i64::try_from(new.device.memory_bytes).unwrap_or(i64::MAX);
    sqlx::query(
        "INSERT INTO workers
             (id, display_name, backend, adapter, gpu, memory_bytes, embedded, create_time, version,
              order_level)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10)",
    )
    .bind(&id)
    .bind(&new.display_name)
    .bind(&new.device.backend)
    .bind(&new.device.adapter)
    .bind(new.device.gpu)
    .bind(memory)
    .bind(new.embedded)
    .bind(now)
    .bind(&new.version)
    .bind(new.order_level)
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

/// Selects workers with the job that each runs or helps with, and when it last reported on it: `?1` seconds
/// before its lease ends.
macro_rules! select_workers {
    ($rest:literal) => {
        concat!(
            "SELECT w.*, l.job, l.lease_deadline - ?1 AS reported,
                 (SELECT group_concat(kind, ' ' ORDER BY kind) FROM worker_kinds
                  WHERE worker = w.id) AS kinds
             FROM workers w LEFT JOIN leases l ON l.worker = w.id ",
            $rest
        )
    };
}

/// The workers with `ids`, and those with a job, by their names: two lanes of one process register
/// in either order.
pub async fn active(
    conn: &mut SqliteConnection,
    ids: &[&str],
    lease_seconds: f64,
) -> Result<Vec<WorkerStatus>, StoreError> {
    // Ids are hex digits and dashes: a space separates them.
    let ids = format!(" {} ", ids.join(" "));
    let rows = sqlx::query(select_workers!(
        "WHERE l.job IS NOT NULL OR instr(?2, ' ' || w.id || ' ') > 0 \
         ORDER BY w.display_name, w.ord"
    ))
    .bind(lease_seconds)
    .bind(ids)
    .fetch_all(conn)
    .await
    .during("listing active workers")?;
    rows.iter().map(read).collect()
}

/// All registered workers, newest first.
pub async fn list(
    conn: &mut SqliteConnection,
    page: Page,
    lease_seconds: f64,
) -> Result<Vec<Entry<WorkerStatus>>, StoreError> {
    let rows = sqlx::query(select_workers!(
        "WHERE w.ord < ?2 ORDER BY w.ord DESC LIMIT ?3"
    ))
    .bind(lease_seconds)
    .bind(page.after.unwrap_or(i64::MAX))
    .bind(page.limit)
    .fetch_all(conn)
    .await
    .during("listing workers")?;
    rows.iter()
        .map(|row| {
            Ok(Entry {
                position: row.number("ord")?,
                item: read(row)?,
            })
        })
        .collect()
}

/// Forgets workers that registered more than `keep` seconds ago and that neither a job nor its history names.
pub async fn forget(conn: &mut SqliteConnection, keep: f64, now: f64) -> Result<u64, StoreError> {
    let done = sqlx::query(concat!(
        "DELETE FROM workers WHERE ",
        age!("create_time"),
        " > ?2
             AND NOT EXISTS (SELECT 1 FROM jobs j WHERE j.worker = workers.id)
             AND NOT EXISTS (SELECT 1 FROM job_attempts a WHERE a.worker = workers.id)"
    ))
    .bind(now)
    .bind(keep)
    .execute(conn)
    .await
    .during("forgetting old workers")?;
    Ok(done.rows_affected())
}

fn read(row: &SqliteRow) -> Result<WorkerStatus, StoreError> {
    let kinds = row.maybe_text("kinds")?.unwrap_or_default();
    let kinds = kinds.split(' ').filter(|kind| !kind.is_empty());
    let kinds = kinds.map(|kind| Ok(JobKind::of_column(kind)?.to_proto() as i32));
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
        kinds: kinds.collect::<Result<_, StoreError>>()?,
        last_seen: row.time("reported")?,
        job: job.map_or_else(String::new, |id| Collection::Jobs.name(&id)),
        version: row.text("version")?,
        order_level: row.number("order_level")?,
    })
}
