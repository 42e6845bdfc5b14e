//! What tenants use: what they have now, and what workers have done for them.

use crate::db::{Row, Tx, sql};
use crate::{LeaseKey, StoreError, Tenant};
use yoto_proto::v1::{Quota, StoredBytes, Usage};

/// Seconds of a day.
const DAY: f64 = 86_400.0;
/// Days before today whose work counts.
const PAST_DAYS: i64 = 30;

/// Columns of the bytes of all files that rows of the tenant `$1` name, by what they are.
macro_rules! stored {
    () => {
        "CAST(
             (SELECT coalesce(sum(f.bytes), 0) FROM capture_files f
              JOIN captures c ON c.id = f.capture JOIN subjects s ON s.id = c.subject
              WHERE s.tenant = $1 AND c.files_removed = 0)
         AS BIGINT) AS uploads, CAST(
             (SELECT coalesce(sum(c.shard_bytes), 0) FROM captures c JOIN subjects s ON s.id = c.subject
              WHERE s.tenant = $1)
           + (SELECT coalesce(sum(o.bytes), 0) FROM capture_objects o
              JOIN captures c ON c.id = o.capture JOIN subjects s ON s.id = c.subject
              WHERE s.tenant = $1)
         AS BIGINT) AS captures, CAST(
             (SELECT coalesce(sum(p.bytes + p.manifest_bytes), 0) FROM checkpoints p
              JOIN models m ON m.id = p.model WHERE m.tenant = $1)
         AS BIGINT) AS checkpoints, CAST(
             (SELECT coalesce(sum(o.bytes), 0) FROM job_outputs o JOIN jobs j ON j.id = o.job
              WHERE j.tenant = $1)
         AS BIGINT) AS results"
    };
}

/// Columns of the work for the tenant `$1` from the day `$2` until now, the time `$3`.
macro_rules! work {
    () => {
        "(SELECT coalesce(sum(d.device_seconds), 0.0) FROM work_of_days d
              WHERE d.tenant = $1 AND d.day >= $2) AS past_seconds,
         (SELECT coalesce(sum($3 - a.begin_time), 0.0) FROM jobs j JOIN job_attempts a ON a.job = j.id
              WHERE j.tenant = $1 AND j.state = 'RUNNING' AND a.end_time IS NULL AND a.begin_time < $3) AS running_seconds,
         CAST((SELECT coalesce(sum(d.pictures), 0) FROM work_of_days d
              WHERE d.tenant = $1 AND d.day >= $2) AS BIGINT) AS drawn"
    };
}

/// A column of the number of people of the tenant `$1`.
macro_rules! people {
    () => {
        "(SELECT count(*) FROM subjects s WHERE s.tenant = $1) AS persons"
    };
}

/// A column of the number of jobs of the tenant `$1` that wait or run.
macro_rules! open_jobs {
    () => {
        "(SELECT count(*) FROM jobs j WHERE j.tenant = $1 AND j.state IN ('QUEUED', 'RUNNING')) AS open"
    };
}

/// What a tenant uses, with its quota.
pub(crate) async fn of(tx: &mut Tx, tenant: &Tenant) -> Result<Usage, StoreError> {
    let row = sql(concat!(
        "SELECT q.*, ",
        people!(),
        ", ",
        open_jobs!(),
        ", ",
        stored!(),
        ", ",
        work!(),
        // A tenant without a quota has no row of it.
        " FROM (SELECT 1 AS one) AS base LEFT JOIN quotas q ON q.tenant = $1"
    ))
    .bind(tenant.id())
    .bind(day(tx.now()) - PAST_DAYS)
    .bind(tx.now())
    .one(tx, "adding up what a tenant uses")
    .await?;
    let (stored, work) = (read_stored(&row)?, read_work(&row)?);
    Ok(Usage {
        tenant: tenant.id().to_owned(),
        people: row.number("persons")?,
        bytes: total(&stored),
        open_jobs: row.number("open")?,
        device_seconds: work.device_seconds,
        pictures: work.pictures,
        quota: Some(read(&row)?),
        stored: Some(stored),
    })
}

/// The ids of all tenants that have anything, ordered.
pub(crate) async fn tenants(tx: &mut Tx) -> Result<Vec<Tenant>, StoreError> {
    let rows = sql("SELECT tenant FROM keys UNION SELECT tenant FROM quotas UNION SELECT tenant FROM work_of_days
         UNION SELECT tenant FROM subjects UNION SELECT tenant FROM models UNION SELECT tenant FROM jobs ORDER BY tenant")
    .rows(tx, "listing tenants")
    .await?;
    let ids = rows.iter().map(|row| row.text("tenant"));
    let mut tenants = Vec::new();
    for id in ids {
        tenants.extend(Tenant::new(&id?));
    }
    Ok(tenants)
}

/// The quota of a tenant; without a row, one without limits.
pub(crate) async fn quota(tx: &mut Tx, tenant: &Tenant) -> Result<Quota, StoreError> {
    let row = sql("SELECT * FROM quotas WHERE tenant = $1")
        .bind(tenant.id())
        .row(tx, "reading a quota")
        .await?;
    row.map_or(Ok(Quota::default()), |row| read(&row))
}

fn read(row: &Row) -> Result<Quota, StoreError> {
    Ok(Quota {
        people: row.maybe_number("people")?,
        bytes: row.maybe_number("bytes")?,
        open_jobs: row.maybe_number("open_jobs")?,
        device_seconds: row.real("device_seconds")?,
        pictures: row.maybe_number("pictures")?,
        calls_per_second: row.real("calls_per_second")?,
    })
}

/// Number of people.
pub(crate) async fn people(tx: &mut Tx, tenant: &Tenant) -> Result<u64, StoreError> {
    sql(concat!("SELECT ", people!()))
        .bind(tenant.id())
        .one(tx, "counting people")
        .await?
        .number("persons")
}

/// Number of jobs that wait or run.
pub(crate) async fn open_jobs(tx: &mut Tx, tenant: &Tenant) -> Result<u64, StoreError> {
    sql(concat!("SELECT ", open_jobs!()))
        .bind(tenant.id())
        .one(tx, "counting open jobs")
        .await?
        .number("open")
}

/// Bytes of all files that rows of the tenant name. Files of an upload count as announced.
pub(crate) async fn bytes(tx: &mut Tx, tenant: &Tenant) -> Result<u64, StoreError> {
    let row = sql(concat!("SELECT ", stored!()))
        .bind(tenant.id())
        .one(tx, "adding up the bytes of a tenant")
        .await?;
    Ok(total(&read_stored(&row)?))
}

fn total(stored: &StoredBytes) -> u64 {
    stored.uploads + stored.captures + stored.checkpoints + stored.results
}

fn read_stored(row: &Row) -> Result<StoredBytes, StoreError> {
    Ok(StoredBytes {
        uploads: row.number("uploads")?,
        captures: row.number("captures")?,
        checkpoints: row.number("checkpoints")?,
        results: row.number("results")?,
    })
}

/// What workers have done.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Work {
    /// Seconds for which they had jobs.
    pub device_seconds: f64,
    /// Pictures of renders.
    pub pictures: u64,
}

/// What workers have done for a tenant today and in the days before, with what they do now.
pub(crate) async fn work(tx: &mut Tx, tenant: &Tenant) -> Result<Work, StoreError> {
    let row = sql(concat!("SELECT ", work!()))
        .bind(tenant.id())
        .bind(day(tx.now()) - PAST_DAYS)
        .bind(tx.now())
        .one(tx, "adding up the work for a tenant")
        .await?;
    read_work(&row)
}

fn read_work(row: &Row) -> Result<Work, StoreError> {
    let past = row.real("past_seconds")?.unwrap_or_default();
    let running = row.real("running_seconds")?.unwrap_or_default();
    Ok(Work {
        device_seconds: past + running,
        pictures: row.number("drawn")?,
    })
}

/// Counts the seconds of the attempt of a lease, which ends now.
pub(crate) async fn attempt_ends(tx: &mut Tx, lease: &LeaseKey) -> Result<(), StoreError> {
    sql("INSERT INTO work_of_days (tenant, day, device_seconds)
         SELECT j.tenant, $3, CASE WHEN a.begin_time < $4 THEN $4 - a.begin_time ELSE 0.0 END
         FROM job_attempts a JOIN jobs j ON j.id = a.job
         WHERE a.job = $1 AND a.lease = $2 AND a.end_time IS NULL
         ON CONFLICT (tenant, day) DO UPDATE
             SET device_seconds = work_of_days.device_seconds + excluded.device_seconds")
    .bind(&lease.job_id)
    .bind(lease.column()?)
    .bind(day(tx.now()))
    .bind(tx.now())
    .execute(tx, "counting the seconds of an attempt")
    .await?;
    Ok(())
}

/// Counts a picture, if the job is a render.
pub(crate) async fn picture(tx: &mut Tx, job_id: &str) -> Result<(), StoreError> {
    sql("INSERT INTO work_of_days (tenant, day, pictures)
         SELECT tenant, $2, 1 FROM jobs WHERE id = $1 AND kind = 'render'
         ON CONFLICT (tenant, day) DO UPDATE SET pictures = work_of_days.pictures + 1")
    .bind(job_id)
    .bind(day(tx.now()))
    .execute(tx, "counting a picture")
    .await?;
    Ok(())
}

/// Days since 1970 at `now`, seconds since then.
fn day(now: f64) -> i64 {
    (now / DAY).floor() as i64
}
