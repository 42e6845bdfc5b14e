//! Ranges of a render's pictures, each drawn by one lease at a time.

use super::leases::is_held;
use super::outputs;
use crate::db::{Tx, sql};
use crate::rules::ranges::split;
use crate::{LeaseKey, StoreError, TakenRange};
use yoto_proto::v1::ErrorReason;
use yoto_proto::worker::v1::PictureRange;

/// Marks the range that begins at `drawn` as drawn by the lease, and assigns the next one to it, or returns the
/// range that it already has. Also returns whether all pictures are drawn.
pub(crate) async fn take(
    tx: &mut Tx,
    lease: &LeaseKey,
    pictures: u32,
    drawn: Option<u32>,
) -> Result<(Option<PictureRange>, bool), StoreError> {
    if !is_held(tx, lease).await? {
        return Err(lease.stale());
    }
    divide(tx, lease, pictures).await?;
    if let Some(first) = drawn {
        sql("UPDATE render_ranges SET drawn = 1, token = NULL
             WHERE job = $1 AND token = $2 AND first = $3")
        .bind(&lease.job_id)
        .bind(lease.column()?)
        .bind(first)
        .execute(tx, "recording drawn pictures")
        .await?;
    }
    let range = next(tx, lease).await?;
    let row = sql("SELECT min(drawn) AS finished FROM render_ranges WHERE job = $1")
        .bind(&lease.job_id)
        .one(tx, "looking for pictures to draw")
        .await?;
    let finished = row.flag("finished")?;
    Ok((range, finished))
}

/// The committed files of a `range` that was taken; of a finished render, all of its files. Read outside the
/// transaction that took the range: a render has thousands of files, and other writers would wait.
pub(crate) async fn taken(
    tx: &mut Tx,
    job_id: &str,
    range: Option<PictureRange>,
    finished: bool,
) -> Result<TakenRange, StoreError> {
    let outputs = match &range {
        _ if finished => outputs::list(tx, job_id).await?,
        Some(range) => outputs::between(tx, job_id, range).await?,
        None => Vec::new(),
    };
    Ok(TakenRange {
        range,
        outputs,
        committed: outputs::count(tx, job_id).await?,
        finished,
    })
}

/// Divides the render into ranges, unless an earlier lease did. The count of the worker that runs the job
/// decides, since its version may be newer than that of the last one.
async fn divide(tx: &mut Tx, lease: &LeaseKey, pictures: u32) -> Result<(), StoreError> {
    let row = sql(
        "SELECT (SELECT CAST(coalesce(sum(pictures), 0) AS BIGINT) FROM render_ranges WHERE job = $1) AS pictures,
             EXISTS (SELECT 1 FROM jobs WHERE id = $1 AND lease = $2 AND state = 'RUNNING') AS runs",
    )
    .bind(&lease.job_id)
    .bind(lease.column()?)
    .one(tx, "reading the ranges of a render").await?;
    let known: u32 = row.number("pictures")?;
    if known == pictures {
        return Ok(());
    }
    if !row.flag("runs")? {
        let message = format!("the render has {known} pictures, not {pictures}");
        return Err(StoreError::Rule {
            reason: ErrorReason::OtherPictures,
            message,
        });
    }
    sql("DELETE FROM render_ranges WHERE job = $1")
        .bind(&lease.job_id)
        .execute(tx, "dividing a render")
        .await?;
    for (first, count) in split(pictures) {
        sql("INSERT INTO render_ranges (job, first, pictures) VALUES ($1, $2, $3)")
            .bind(&lease.job_id)
            .bind(first)
            .bind(count)
            .execute(tx, "dividing a render")
            .await?;
    }
    Ok(())
}

/// The range that the lease draws; the first free one if it has none.
async fn next(tx: &mut Tx, lease: &LeaseKey) -> Result<Option<PictureRange>, StoreError> {
    let row = sql(
        "UPDATE render_ranges SET token = $2 WHERE job = $1 AND first = coalesce(
             (SELECT min(first) FROM render_ranges WHERE job = $1 AND token = $2),
             (SELECT min(first) FROM render_ranges WHERE job = $1 AND token IS NULL AND drawn = 0))
         RETURNING first, pictures",
    )
    .bind(&lease.job_id)
    .bind(lease.column()?)
    .row(tx, "taking pictures to draw")
    .await?;
    row.map(|row| {
        Ok(PictureRange {
            first: row.number("first")?,
            count: row.number("pictures")?,
        })
    })
    .transpose()
}

/// Whether a render was divided into ranges, that is, a worker has begun to draw it.
pub(crate) async fn any(tx: &mut Tx, job_id: &str) -> Result<bool, StoreError> {
    sql("SELECT EXISTS (SELECT 1 FROM render_ranges WHERE job = $1) AS found")
        .bind(job_id)
        .one(tx, "reading the ranges of a render")
        .await?
        .flag("found")
}

/// Frees the ranges that an ending lease has not drawn.
pub(crate) async fn release(tx: &mut Tx, lease: &LeaseKey) -> Result<(), StoreError> {
    sql("UPDATE render_ranges SET token = NULL WHERE job = $1 AND token = $2")
        .bind(&lease.job_id)
        .bind(lease.column()?)
        .execute(tx, "releasing the pictures of a lease")
        .await?;
    Ok(())
}
