//! Uploads: captures that are still arriving. Each file has a number of committed bytes.

use super::steps::age;
use super::{captures, erasures, garbage, jobs, quotas, requests, upload_parts};
use crate::db::{Lock, Tx, integer, sql};
use crate::{NewJob, NewUpload, RequestKey, StoreError, Tenant, Upload, UploadFile, new_id};
use yoto_proto::keys;
use yoto_proto::media_plan::film_alone;
use yoto_proto::names::Collection;
use yoto_proto::v1::{Capture, ErrorReason, IngestSpec, JobSpec, job_spec};

/// Rows of one INSERT; SQLite allows 32,766 parameters in a statement.
const ROWS_PER_STATEMENT: usize = 4000;
/// The call that opens an upload, under which its request id is stored.
pub(crate) const CREATE: &str = "CreateUpload";

pub(super) fn not_found(id: &str) -> StoreError {
    StoreError::NotFound {
        name: Collection::Uploads.name(id),
    }
}

/// Opens an upload, or returns the one that `request` opened before. Returns its id.
pub(crate) async fn create(
    tx: &mut Tx,
    tenant: &Tenant,
    new: NewUpload,
    request: Option<RequestKey>,
) -> Result<String, StoreError> {
    if let Some(id) = requests::begin(tx, tenant, request.as_ref()).await? {
        return Ok(id);
    }
    let coming = new
        .files
        .iter()
        .fold(0, |sum: u64, it| sum.saturating_add(it.bytes));
    quotas::admit_upload(tx, tenant, coming).await?;
    tx.lock(Lock::Subject(&new.subject_id)).await?;
    let id = new_id();
    let done = sql("INSERT INTO captures (id, subject, create_time, idle_since)
             SELECT $1, id, $3, $3 FROM subjects WHERE id = $2 AND tenant = $4")
    .bind(&id)
    .bind(&new.subject_id)
    .bind(tx.now())
    .bind(tenant.id())
    .execute(tx, "opening an upload")
    .await?;
    if done == 0 {
        return Err(StoreError::NotFound {
            name: Collection::Subjects.name(&new.subject_id),
        });
    }
    erasures::refuse_if_begun(tx, &new.subject_id).await?;
    for chunk in new.files.chunks(ROWS_PER_STATEMENT) {
        let mut rows = sql("INSERT INTO capture_files (capture, path, bytes, sha256) VALUES ");
        for (number, file) in chunk.iter().enumerate() {
            rows.push(if number == 0 { "(" } else { ", (" });
            rows.push_bind(&id);
            rows.push(", ");
            rows.push_bind(&file.path);
            rows.push(", ");
            rows.push_bind(integer("files.bytes", file.bytes)?);
            rows.push(", ");
            rows.push_bind(&file.sha256);
            rows.push(")");
        }
        rows.execute(tx, "recording a capture's files").await?;
    }
    requests::remember(tx, tenant, request.as_ref(), &id).await?;
    Ok(id)
}

/// Checks that the tenant has the upload, finished or not.
pub(crate) async fn require(tx: &mut Tx, tenant: &Tenant, id: &str) -> Result<(), StoreError> {
    let row = sql(
        "SELECT EXISTS (SELECT 1 FROM captures c JOIN subjects s ON s.id = c.subject
             WHERE c.id = $1 AND s.tenant = $2) AS found",
    )
    .bind(id)
    .bind(tenant.id())
    .one(tx, "looking for an upload")
    .await?;
    match row.flag("found")? {
        true => Ok(()),
        false => Err(not_found(id)),
    }
}

/// An upload by id, finished or not.
pub(crate) async fn get(tx: &mut Tx, tenant: &Tenant, id: &str) -> Result<Upload, StoreError> {
    let row = sql(
        "SELECT c.subject, c.state, c.idle_since FROM captures c JOIN subjects s ON s.id = c.subject
         WHERE c.id = $1 AND s.tenant = $2")
        .bind(id)
        .bind(tenant.id())
        .row(tx, "reading an upload").await?
        .ok_or_else(|| not_found(id))?;
    let files = sql(
        "SELECT path, bytes, sha256, committed FROM capture_files WHERE capture = $1 ORDER BY path",
    )
    .bind(id)
    .rows(tx, "listing an upload's files")
    .await?;
    let files = files.iter().map(|row| {
        Ok(UploadFile {
            path: row.text("path")?,
            bytes: row.number("bytes")?,
            sha256: row.text("sha256")?,
            committed: row.number("committed")?,
        })
    });
    Ok(Upload {
        id: id.to_owned(),
        subject_id: row.text("subject")?,
        open: row.text("state")? == "UPLOADING",
        write_time: row.real("idle_since")?.unwrap_or_default(),
        files: files.collect::<Result<_, StoreError>>()?,
        newest: upload_parts::newest(tx, id).await?,
        pieces: upload_parts::pieces(tx, id).await?,
    })
}

/// Makes the caller the newest writer of an upload, so that earlier ones commit nothing more, wherever they run. Returns
/// the writer's number.
pub(crate) async fn take_over(tx: &mut Tx, tenant: &Tenant, id: &str) -> Result<u64, StoreError> {
    tx.lock(Lock::Capture(id)).await?;
    let row = sql("UPDATE captures SET writer = writer + 1 WHERE id = $1
             AND subject IN (SELECT id FROM subjects WHERE tenant = $2) RETURNING writer")
    .bind(id)
    .bind(tenant.id())
    .row(tx, "taking over an upload")
    .await?;
    row.ok_or_else(|| not_found(id))?.number("writer")
}

/// Checks that the tenant's upload is open and that `writer` is its newest writer.
pub(crate) async fn require_writer(
    tx: &mut Tx,
    tenant: &Tenant,
    id: &str,
    writer: u64,
) -> Result<(), StoreError> {
    let row = sql(
        "SELECT c.state, c.writer FROM captures c JOIN subjects s ON s.id = c.subject
         WHERE c.id = $1 AND s.tenant = $2",
    )
    .bind(id)
    .bind(tenant.id())
    .row(tx, "looking for the writer of an upload")
    .await?
    .ok_or_else(|| not_found(id))?;
    if row.text("state")? != "UPLOADING" {
        return Err(StoreError::upload_finished(id));
    }
    let newest: u64 = row.number("writer")?;
    match newest == writer {
        true => Ok(()),
        false => Err(StoreError::taken_over(id)),
    }
}

/// Bytes of all open uploads, of all tenants, that are still to come.
pub(crate) async fn coming(tx: &mut Tx) -> Result<u64, StoreError> {
    sql(
        "SELECT CAST(coalesce(sum(f.bytes - f.committed), 0) AS BIGINT) AS coming
         FROM captures c JOIN capture_files f ON f.capture = c.id WHERE c.state = 'UPLOADING'",
    )
    .one(tx, "adding up the open uploads")
    .await?
    .number("coming")
}

/// Begins a change of a capture, with its lock. Returns the capture if the same request has changed it before.
async fn begin(
    tx: &mut Tx,
    tenant: &Tenant,
    id: &str,
    request: Option<&RequestKey>,
) -> Result<Option<Capture>, StoreError> {
    if requests::begin(tx, tenant, request).await?.is_some() {
        return captures::get(tx, tenant, id).await.map(Some);
    }
    tx.lock(Lock::Capture(id)).await?;
    Ok(None)
}

/// Ends an upload whose files `writer` has compared with their checksums, and queues its ingest job. One that has ended
/// already is not changed.
pub(crate) async fn finish(
    tx: &mut Tx,
    tenant: &Tenant,
    id: &str,
    writer: u64,
    request: Option<RequestKey>,
) -> Result<Capture, StoreError> {
    if let Some(done) = begin(tx, tenant, id, request.as_ref()).await? {
        return Ok(done);
    }
    let done = sql(
        "UPDATE captures SET state = 'INGESTING' WHERE id = $1 AND state = 'UPLOADING' AND writer = $3
             AND subject IN (SELECT id FROM subjects WHERE tenant = $2)
             AND NOT EXISTS (SELECT 1 FROM capture_files f WHERE f.capture = $1 AND f.committed < f.bytes)",
    )
    .bind(id)
    .bind(tenant.id())
    .bind(integer("writer", writer)?)
    .execute(tx, "ending an upload").await?;
    if done > 0 {
        ingest(tx, tenant, id).await?;
    } else if get(tx, tenant, id).await?.open {
        if !upload_parts::is_newest(tx, id, writer).await? {
            return Err(StoreError::taken_over(id));
        }
        return Err(StoreError::Rule {
            reason: ErrorReason::UploadIncomplete,
            message: format!("{} is not complete", Collection::Uploads.name(id)),
        });
    }
    requests::remember(tx, tenant, request.as_ref(), id).await?;
    captures::get(tx, tenant, id).await
}

/// Queues an ingest job of the capture.
async fn ingest(tx: &mut Tx, tenant: &Tenant, id: &str) -> Result<(), StoreError> {
    let ingest = IngestSpec {
        capture: Collection::Captures.name(id),
    };
    let spec = JobSpec {
        kind: Some(job_spec::Kind::Ingest(ingest)),
    };
    jobs::insert(tx, tenant, NewJob::normal(spec))
        .await
        .map(drop)
}

/// Whether the capture is a film without poses.
pub(crate) async fn is_film(tx: &mut Tx, id: &str) -> Result<bool, StoreError> {
    let rows = sql("SELECT path FROM capture_files WHERE capture = $1 LIMIT 2")
        .bind(id)
        .rows(tx, "looking for a film")
        .await?;
    let paths: Result<Vec<String>, _> = rows.iter().map(|row| row.text("path")).collect();
    Ok(film_alone(paths?.iter().map(String::as_str)).is_some())
}

/// Queues another ingest job for a capture whose last one made no shard.
pub(crate) async fn ingest_again(
    tx: &mut Tx,
    tenant: &Tenant,
    id: &str,
    request: Option<RequestKey>,
) -> Result<Capture, StoreError> {
    if let Some(done) = begin(tx, tenant, id, request.as_ref()).await? {
        return Ok(done);
    }
    let before = captures::get(tx, tenant, id).await?;
    if files_removed(tx, id).await? {
        return Err(StoreError::upload_gone(id));
    }
    let done = sql(
        "UPDATE captures SET state = 'INGESTING' WHERE id = $1 AND state IN ('UPLOADED', 'REJECTED')",
    )
    .bind(id)
    .execute(tx, "starting an ingest anew").await?;
    if done == 0 {
        return Err(StoreError::Rule {
            reason: ErrorReason::NotRepeatable,
            message: format!(
                "{} is {}: only one that is UPLOADED or REJECTED is read again",
                before.name,
                before.state().as_str_name()
            ),
        });
    }
    sql("DELETE FROM capture_violations WHERE capture = $1")
        .bind(id)
        .execute(tx, "forgetting a capture's violations")
        .await?;
    ingest(tx, tenant, id).await?;
    requests::remember(tx, tenant, request.as_ref(), id).await?;
    captures::get(tx, tenant, id).await
}

/// Whether the files of the capture were removed, or are being removed.
async fn files_removed(tx: &mut Tx, id: &str) -> Result<bool, StoreError> {
    sql("SELECT EXISTS (SELECT 1 FROM captures WHERE id = $1 AND files_removed = 1) AS found")
        .bind(id)
        .one(tx, "looking for the files of an upload")
        .await?
        .flag("found")
}

/// Ends the uploads without a write for `idle` seconds. Returns their ids.
pub(crate) async fn expire(tx: &mut Tx, idle: f64, at: f64) -> Result<Vec<String>, StoreError> {
    let rows = sql(concat!(
        "DELETE FROM captures WHERE state = 'UPLOADING' AND ",
        age!("idle_since"),
        " >= $2 RETURNING id"
    ))
    .bind(at)
    .bind(idle)
    .rows(tx, "ending idle uploads")
    .await?;
    let mut ended = Vec::with_capacity(rows.len());
    for row in &rows {
        let id = row.text("id")?;
        forget(tx, &id).await?;
        ended.push(id);
    }
    Ok(ended)
}

/// Notes the files of a removed upload as garbage, and frees its request id, so that the same files can be
/// uploaded again.
pub(crate) async fn forget(tx: &mut Tx, id: &str) -> Result<(), StoreError> {
    garbage::deleted(tx, &keys::upload_folder(id)).await?;
    sql("DELETE FROM request_ids WHERE method = $1 AND answer = $2")
        .bind(CREATE)
        .bind(id)
        .execute(tx, "freeing a request id")
        .await?;
    Ok(())
}
