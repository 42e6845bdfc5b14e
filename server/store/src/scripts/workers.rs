//! Workers and the kinds of jobs that they run.

use super::page;
use super::steps::age;
use crate::db::{Row, Tx, sql, timestamp};
use crate::{Entry, JobKind, NewWorker, Page, StoreError, Tenant, new_id};
use yoto_proto::names::Collection;
use yoto_proto::v1::{WorkerDevice, WorkerStatus};

/// Adds a worker.
pub(crate) async fn register(
    tx: &mut Tx,
    tenant: &Tenant,
    new: NewWorker,
) -> Result<String, StoreError> {
    let id = new_id();
    // No device has more memory than fits into the column.
    let memory = i64::try_from(new.device.memory_bytes).unwrap_or(i64::MAX);
    sql("INSERT INTO workers
             (id, display_name, backend, adapter, gpu, memory_bytes, embedded, create_time, tenant,
              version, order_level, instance, key, reads_films)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13, $14)")
    .bind(&id)
    .bind(&new.display_name)
    .bind(&new.device.backend)
    .bind(&new.device.adapter)
    .bind(new.device.gpu)
    .bind(memory)
    .bind(new.embedded.is_some())
    .bind(tx.now())
    .bind(tenant.id())
    .bind(&new.version)
    .bind(new.order_level)
    .bind(new.embedded)
    .bind(new.key)
    .bind(new.reads_films)
    .execute(tx, "registering a worker")
    .await?;
    for kind in new.kinds {
        sql("INSERT INTO worker_kinds (worker, kind) VALUES ($1, $2)
             ON CONFLICT (worker, kind) DO NOTHING")
        .bind(&id)
        .bind(kind.as_str())
        .execute(tx, "recording what a worker runs")
        .await?;
    }
    Ok(id)
}

/// Checks that the tenant has the worker.
pub(crate) async fn require(tx: &mut Tx, tenant: &Tenant, id: &str) -> Result<(), StoreError> {
    let row = sql("SELECT EXISTS (SELECT 1 FROM workers WHERE id = $1 AND tenant = $2) AS found")
        .bind(id)
        .bind(tenant.id())
        .one(tx, "looking for a worker")
        .await?;
    match row.flag("found")? {
        true => Ok(()),
        false => Err(not_found(id)),
    }
}

pub(super) fn not_found(id: &str) -> StoreError {
    StoreError::NotFound {
        name: Collection::Workers.name(id),
    }
}

/// Checks that the tenant's worker has registered with this key.
pub(crate) async fn require_key(
    tx: &mut Tx,
    tenant: &Tenant,
    id: &str,
    key: &str,
) -> Result<(), StoreError> {
    let row = sql(
        "SELECT EXISTS (SELECT 1 FROM workers WHERE id = $1 AND tenant = $2 AND key = $3) AS found",
    )
    .bind(id)
    .bind(tenant.id())
    .bind(key)
    .one(tx, "looking for a worker of a key")
    .await?;
    match row.flag("found")? {
        true => Ok(()),
        false => Err(not_found(id)),
    }
}

/// Interval of recorded requests of a worker, seconds. Workers ask every second: a write each time would keep the disk busy.
pub(super) const NOTE_EVERY: f64 = 30.0;
/// Silence after which a worker is no longer active, seconds.
const ACTIVE: f64 = 600.0;

/// Notes that the worker asks for a job now.
pub(crate) async fn note_request(tx: &mut Tx, id: &str) -> Result<(), StoreError> {
    sql("UPDATE workers SET asked_time = $2 WHERE id = $1")
        .bind(id)
        .bind(tx.now())
        .execute(tx, "noting a worker's request")
        .await?;
    Ok(())
}

/// Selects workers with the job that each runs or helps with, and when it last reported on it: `$1` seconds
/// before its lease ends.
macro_rules! select_workers {
    ($rest:literal) => {
        concat!(
            "SELECT w.*, l.job, l.lease_deadline - $1 AS reported,
                 (SELECT string_agg(kind, ' ' ORDER BY kind) FROM worker_kinds
                  WHERE worker = w.id) AS kinds
             FROM workers w LEFT JOIN leases l ON l.worker = w.id ",
            $rest
        )
    };
}

/// The workers with a job, and those that have asked for one lately, by their names: two lanes of one process
/// register in either order. After a clock was set back, a request in the future counts as late as well.
pub(crate) async fn active(
    tx: &mut Tx,
    tenant: &Tenant,
    lease_seconds: f64,
) -> Result<Vec<WorkerStatus>, StoreError> {
    let rows = sql(select_workers!(
        "WHERE w.tenant = $2 AND (l.job IS NOT NULL OR w.asked_time > $3)
         ORDER BY w.display_name, w.ord"
    ))
    .bind(lease_seconds)
    .bind(tenant.id())
    .bind(tx.now() - ACTIVE)
    .rows(tx, "listing active workers")
    .await?;
    rows.iter().map(read).collect()
}

/// Whether a worker of the tenant with a pose model has a job, or has registered or asked for one lately.
pub(crate) async fn any_reads_films(tx: &mut Tx, tenant: &Tenant) -> Result<bool, StoreError> {
    sql("SELECT EXISTS (SELECT 1 FROM workers w
             WHERE w.tenant = $1 AND w.reads_films = 1
                 AND (coalesce(w.asked_time, w.create_time) > $2 OR EXISTS (SELECT 1 FROM leases l WHERE l.worker = w.id))) AS found")
    .bind(tenant.id())
    .bind(tx.now() - ACTIVE)
    .one(tx, "looking for a worker with a pose model")
    .await?
    .flag("found")
}

/// Number of workers with a job, or that have asked for one lately, of all tenants.
pub(crate) async fn count(tx: &mut Tx) -> Result<u64, StoreError> {
    sql("SELECT count(*) AS workers FROM workers w
         WHERE w.asked_time > $1 OR EXISTS (SELECT 1 FROM leases l WHERE l.worker = w.id)")
    .bind(tx.now() - ACTIVE)
    .one(tx, "counting workers")
    .await?
    .number("workers")
}

/// All registered workers, newest first.
pub(crate) async fn list(
    tx: &mut Tx,
    tenant: &Tenant,
    page: Page,
    lease_seconds: f64,
) -> Result<Vec<Entry<WorkerStatus>>, StoreError> {
    let rows = sql(select_workers!(
        "WHERE w.tenant = $4 AND w.ord < $2 ORDER BY w.ord DESC LIMIT $3"
    ))
    .bind(lease_seconds)
    .bind(page.after.unwrap_or(i64::MAX))
    .bind(page.limit)
    .bind(tenant.id())
    .rows(tx, "listing workers")
    .await?;
    page::entries(&rows, read)
}

/// Forgets workers that registered, and last asked for a job, more than `keep` seconds ago, and that neither a job nor its
/// history names.
pub(crate) async fn forget(tx: &mut Tx, keep: f64, at: f64) -> Result<u64, StoreError> {
    let done = sql(concat!(
        "DELETE FROM workers WHERE ",
        age!("coalesce(asked_time, create_time)"),
        " > $2
             AND NOT EXISTS (SELECT 1 FROM jobs j WHERE j.worker = workers.id)
             AND NOT EXISTS (SELECT 1 FROM job_attempts a WHERE a.worker = workers.id)"
    ))
    .bind(at)
    .bind(keep)
    .execute(tx, "forgetting old workers")
    .await?;
    Ok(done)
}

fn read(row: &Row) -> Result<WorkerStatus, StoreError> {
    let kinds = row.maybe_text("kinds")?.unwrap_or_default();
    let kinds = kinds.split(' ').filter(|kind| !kind.is_empty());
    let kinds = kinds.map(|kind| Ok(JobKind::of_column(kind)?.to_proto() as i32));
    let job = row.maybe_text("job")?;
    // A worker is seen whenever it asks for a job, and whenever it reports on one.
    let seen = match (row.real("reported")?, row.real("asked_time")?) {
        (Some(reported), Some(asked)) => Some(reported.max(asked)),
        (reported, asked) => reported.or(asked),
    };
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
        last_seen: seen.map(timestamp),
        job: job.map_or_else(String::new, |id| Collection::Jobs.name(&id)),
        version: row.text("version")?,
        order_level: row.number("order_level")?,
        reads_films: row.flag("reads_films")?,
    })
}
