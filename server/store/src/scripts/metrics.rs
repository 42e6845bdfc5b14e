//! Figures of trainings over their steps, written with heartbeats and thinned to a bounded number per job.

use crate::db::{Row, Tx, sql};
use crate::rules::thinning::{MOST, is_worth};
use crate::{StoreError, Tenant};
use std::collections::HashMap;
use yoto_proto::names::Collection;
use yoto_proto::v1::{JobMetrics, MetricPoint, Progress};

/// Columns of what is known of the job `$1`, for [`record`].
macro_rules! known_points {
    () => {
        "(SELECT count(*) FROM job_metrics WHERE job = $1) AS points,
         (SELECT min(step) FROM job_metrics WHERE job = $1) AS first,
         (SELECT max(step) FROM job_metrics WHERE job = $1) AS last,
         (SELECT psnr FROM job_metrics WHERE job = $1 AND psnr IS NOT NULL
          ORDER BY step DESC LIMIT 1) AS psnr"
    };
}
pub(super) use known_points;

/// Whether `progress` has figures of a step.
pub(crate) fn has_figures(progress: &Progress) -> bool {
    let is_step = i64::try_from(progress.step).is_ok_and(|step| step > 0);
    is_step && (progress.loss.is_some() || progress.psnr.is_some())
}

/// Records the figures of `progress`, if it has any and is far enough from the last point. Points of later steps belong to
/// work that was lost, and are forgotten. `row` has the [`known_points!`] of the job.
pub(crate) async fn record(
    tx: &mut Tx,
    job_id: &str,
    progress: &Progress,
    mut row: Row,
) -> Result<(), StoreError> {
    let Ok(step) = i64::try_from(progress.step) else {
        return Ok(());
    };
    if row
        .maybe_number("last")?
        .is_some_and(|last: i64| last > step)
    {
        sql("DELETE FROM job_metrics WHERE job = $1 AND step > $2")
            .bind(job_id)
            .bind(step)
            .execute(tx, "forgetting figures of lost steps")
            .await?;
        let known = sql(concat!("SELECT ", known_points!())).bind(job_id);
        row = known.one(tx, "reading the last figures of a job").await?;
    }
    // Heartbeats repeat the last measurement until the next one.
    let is_measured = progress.psnr.is_some() && row.real("psnr")? != progress.psnr;
    let span = row
        .maybe_number("first")?
        .zip(row.maybe_number("last")?)
        .map(|(first, last): (u64, u64)| (first, last));
    if !is_measured && !is_worth(progress.step, span) {
        return Ok(());
    }
    sql(
        "INSERT INTO job_metrics (job, step, seconds, loss, psnr, ssim) VALUES ($1, $2, $3, $4, $5, $6)
         ON CONFLICT (job, step) DO UPDATE SET seconds = excluded.seconds, loss = excluded.loss,
             psnr = excluded.psnr, ssim = excluded.ssim",
    )
    .bind(job_id)
    .bind(step)
    .bind(progress.train_seconds)
    .bind(progress.loss)
    .bind(progress.psnr.filter(|_| is_measured))
    .bind(progress.ssim.filter(|_| is_measured))
    .execute(tx, "recording figures of a job").await?;
    match row.number::<usize>("points")? {
        points if points >= MOST => thin_out(tx, job_id).await,
        _ => Ok(()),
    }
}

/// Removes every second point, of those with a measurement and those without apart: whichever are half of all, or more.
async fn thin_out(tx: &mut Tx, job_id: &str) -> Result<(), StoreError> {
    sql("DELETE FROM job_metrics WHERE job = $1 AND step IN (
             SELECT step FROM (
                 SELECT step, row_number() OVER (PARTITION BY psnr IS NULL ORDER BY step) AS place,
                     count(*) OVER (PARTITION BY psnr IS NULL) AS points
                 FROM job_metrics WHERE job = $1) AS all_points
             WHERE points >= $2 AND place % 2 = 0 AND place < points)")
    .bind(job_id)
    .bind(MOST as i64 / 2)
    .execute(tx, "thinning out the figures of a job")
    .await?;
    Ok(())
}

/// The figures of a job by step.
pub(crate) async fn of_job(
    tx: &mut Tx,
    tenant: &Tenant,
    job_id: &str,
) -> Result<JobMetrics, StoreError> {
    let rows = sql("SELECT j.id, m.step, m.seconds, m.loss, m.psnr, m.ssim
         FROM jobs j LEFT JOIN job_metrics m ON m.job = j.id
         WHERE j.id = $1 AND j.tenant = $2 ORDER BY m.step")
    .bind(job_id)
    .bind(tenant.id())
    .rows(tx, "reading the figures of a job")
    .await?;
    if rows.is_empty() {
        return Err(StoreError::NotFound {
            name: Collection::Jobs.name(job_id),
        });
    }
    let mut points = Vec::with_capacity(rows.len());
    for row in &rows {
        points.extend(point(row)?);
    }
    Ok(JobMetrics { points })
}

/// The figures of each of these jobs of the tenant by step, by the jobs' ids. A job without figures is missing.
pub(crate) async fn of_jobs(
    tx: &mut Tx,
    tenant: &Tenant,
    jobs: &[&str],
) -> Result<HashMap<String, Vec<MetricPoint>>, StoreError> {
    let mut found: HashMap<String, Vec<MetricPoint>> = HashMap::new();
    if jobs.is_empty() {
        return Ok(found);
    }
    let mut query = sql("SELECT m.job, m.step, m.seconds, m.loss, m.psnr, m.ssim
         FROM job_metrics m JOIN jobs j ON j.id = m.job WHERE j.tenant = $1 AND m.job IN (")
    .bind(tenant.id());
    query.push_all(jobs.iter().copied());
    query.push(") ORDER BY m.job, m.step");
    for row in query.rows(tx, "reading the figures of jobs").await? {
        found
            .entry(row.text("job")?)
            .or_default()
            .extend(point(&row)?);
    }
    Ok(found)
}

/// The figures in a row; `None` in the row of a job without figures, which has no step.
fn point(row: &Row) -> Result<Option<MetricPoint>, StoreError> {
    let Some(step) = row.maybe_number("step")? else {
        return Ok(None);
    };
    Ok(Some(MetricPoint {
        step,
        seconds: row.real("seconds")?.unwrap_or_default(),
        loss: row.real("loss")?,
        psnr: row.real("psnr")?,
        ssim: row.real("ssim")?,
    }))
}
