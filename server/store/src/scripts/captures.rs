//! Captures, and the results of their ingest jobs.

use super::{capture_objects, subjects};
use crate::db::{Lock, Row, Tx, integer, sql, state};
use crate::rules::etag;
use crate::{CaptureFiles, Entry, Page, StoreError, Tenant, UploadedFile};
use std::collections::HashMap;
use yoto_proto::keys::{CHECK, THUMBNAIL};
use yoto_proto::limits;
use yoto_proto::names::{self, Collection};
use yoto_proto::v1::{Capture, IngestResult, RenderedFile, Violation, capture};

fn not_found(id: &str) -> StoreError {
    StoreError::NotFound {
        name: Collection::Captures.name(id),
    }
}

/// Selects captures with their newest ingest job.
macro_rules! select_captures {
    ($rest:literal) => {
        concat!(
            "SELECT c.*, coalesce(c.shard_bytes, 0) AS shard_size,
                 (SELECT j.id FROM jobs j WHERE j.capture = c.id ORDER BY j.ord DESC LIMIT 1)
                     AS ingest_job
             FROM captures c JOIN subjects s ON s.id = c.subject ",
            $rest
        )
    };
}

/// A capture by id.
pub(crate) async fn get(tx: &mut Tx, tenant: &Tenant, id: &str) -> Result<Capture, StoreError> {
    let row = sql(select_captures!("WHERE c.id = $1 AND s.tenant = $2"))
        .bind(id)
        .bind(tenant.id())
        .row(tx, "reading a capture")
        .await?
        .ok_or_else(|| not_found(id))?;
    let read = read(tx, &[row]).await?.into_iter().next();
    Ok(read.ok_or_else(|| not_found(id))?.capture)
}

/// Captures of a person, or of all of the tenant's people, oldest first.
pub(crate) async fn list(
    tx: &mut Tx,
    tenant: &Tenant,
    page: Page,
    subject_id: Option<&str>,
) -> Result<Vec<Entry<CaptureFiles>>, StoreError> {
    let rows = sql(select_captures!(
        "WHERE s.tenant = $1 AND c.ord > $2 AND ($3 IS NULL OR c.subject = $3)
         ORDER BY c.ord LIMIT $4"
    ))
    .bind(tenant.id())
    .bind(page.after.unwrap_or(0))
    .bind(subject_id)
    .bind(page.limit)
    .rows(tx, "listing captures")
    .await?;
    if let (true, Some(id)) = (rows.is_empty(), subject_id) {
        // A person who does not exist is no empty list.
        subjects::get(tx, tenant, id).await?;
    }
    let captures = read(tx, &rows).await?;
    let entries = rows.iter().zip(captures).map(|(row, item)| {
        Ok(Entry {
            position: row.number("ord")?,
            item,
        })
    });
    entries.collect()
}

/// Captures with their files and violations, each of which is read at once for all of them.
async fn read(tx: &mut Tx, rows: &[Row]) -> Result<Vec<CaptureFiles>, StoreError> {
    let (mut ids, mut ready) = (Vec::with_capacity(rows.len()), Vec::new());
    for row in rows {
        ids.push(row.text("id")?);
        if row.text("state")? == capture::State::Ready.as_str_name() {
            ready.push(row.text("id")?);
        }
    }
    let ready: Vec<&str> = ready.iter().map(String::as_str).collect();
    let mut files = capture_objects::of_captures(tx, &ready).await?;
    let mut violations = violations(tx, &ids).await?;
    let captures = rows.iter().zip(&ids).map(|(row, id)| {
        let files = files.remove(id).unwrap_or_default();
        let violations = violations.remove(id).unwrap_or_default();
        let capture = one(row, id, &files, violations)?;
        Ok(CaptureFiles { capture, files })
    });
    captures.collect()
}

fn one(
    row: &Row,
    id: &str,
    files: &[RenderedFile],
    violations: Vec<Violation>,
) -> Result<Capture, StoreError> {
    let ingest_job = row.maybe_text("ingest_job")?;
    let name = Collection::Captures.name(id);
    let object = |file: &str| match files.iter().any(|it| it.file == file) {
        true => names::object(&name, file),
        false => String::new(),
    };
    let mut capture = Capture {
        name: Collection::Captures.name(id),
        subject: Collection::Subjects.name(&row.text("subject")?),
        state: state(
            "captures.state",
            &row.text("state")?,
            capture::State::from_str_name,
        )? as i32,
        frames: row.number("frames")?,
        width: row.number("width")?,
        height: row.number("height")?,
        shard_bytes: row.number("shard_size")?,
        violations,
        create_time: row.time("create_time")?,
        ingest_job: ingest_job
            .map(|job| Collection::Jobs.name(&job))
            .unwrap_or_default(),
        first_frame: row.maybe_number("first_frame")?,
        last_frame: row.maybe_number("last_frame")?,
        etag: String::new(),
        check: object(CHECK),
        thumbnail: object(THUMBNAIL),
    };
    capture.etag = etag::of(&capture);
    Ok(capture)
}

/// The id of the person in a capture.
pub(crate) fn subject_id(capture: &Capture) -> Result<&str, StoreError> {
    let id = Collection::Subjects.parse(&capture.subject);
    id.map_err(|error| StoreError::Corrupt {
        what: "captures.subject",
        detail: error.to_string(),
    })
}

/// The violations of each of these captures, by the captures' ids. A capture without violations is missing.
async fn violations(
    tx: &mut Tx,
    captures: &[String],
) -> Result<HashMap<String, Vec<Violation>>, StoreError> {
    let mut found: HashMap<String, Vec<Violation>> = HashMap::new();
    if captures.is_empty() {
        return Ok(found);
    }
    let mut query = sql("SELECT * FROM capture_violations WHERE capture IN (");
    query.push_all(captures);
    query.push(") ORDER BY number");
    for row in query.rows(tx, "reading the violations of captures").await? {
        let violation = Violation {
            code: row.text("code")?,
            file: row.text("file")?,
            frame: row.maybe_number("frame")?,
            field: row.text("field")?,
            message: row.text("message")?,
        };
        found
            .entry(row.text("capture")?)
            .or_default()
            .push(violation);
    }
    Ok(found)
}

/// The files of a capture, by path.
pub(crate) async fn files(
    tx: &mut Tx,
    tenant: &Tenant,
    id: &str,
) -> Result<Vec<UploadedFile>, StoreError> {
    let rows = sql("SELECT f.path, f.bytes, f.sha256 FROM capture_files f
             JOIN captures c ON c.id = f.capture JOIN subjects s ON s.id = c.subject
         WHERE f.capture = $1 AND s.tenant = $2 ORDER BY f.path")
    .bind(id)
    .bind(tenant.id())
    .rows(tx, "listing a capture's files")
    .await?;
    rows.iter()
        .map(|row| {
            Ok(UploadedFile {
                path: row.text("path")?,
                bytes: row.number("bytes")?,
                sha256: row.text("sha256")?,
            })
        })
        .collect()
}

/// Marks an ingested capture as READY.
pub(crate) async fn accept(tx: &mut Tx, id: &str, result: &IngestResult) -> Result<(), StoreError> {
    tx.lock(Lock::Capture(id)).await?;
    let shard = result.shard.clone().unwrap_or_default();
    sql(
        "UPDATE captures SET state = 'READY', frames = $2, width = $3, height = $4,
             shard_key = $5, shard_bytes = $6, shard_sha256 = $7,
             first_frame = $8, last_frame = $9
         WHERE id = $1 AND state = 'INGESTING'",
    )
    .bind(id)
    .bind(result.frames)
    .bind(result.width)
    .bind(result.height)
    .bind(shard.key)
    .bind(integer("result.ingest.shard.bytes", shard.bytes)?)
    .bind(shard.sha256)
    .bind(result.first_frame)
    .bind(result.last_frame)
    .execute(tx, "marking a capture READY")
    .await?;
    capture_objects::record(tx, id, result).await
}

/// Marks a capture as UPLOADED: its ingest failed through no fault of its files, and can be repeated.
pub(crate) async fn put_back(tx: &mut Tx, id: &str) -> Result<(), StoreError> {
    tx.lock(Lock::Capture(id)).await?;
    sql("UPDATE captures SET state = 'UPLOADED' WHERE id = $1 AND state = 'INGESTING'")
        .bind(id)
        .execute(tx, "marking a capture UPLOADED")
        .await?;
    Ok(())
}

/// Marks a capture as REJECTED, with the reasons.
pub(crate) async fn reject(
    tx: &mut Tx,
    id: &str,
    violations: &[Violation],
) -> Result<(), StoreError> {
    tx.lock(Lock::Capture(id)).await?;
    sql("UPDATE captures SET state = 'REJECTED' WHERE id = $1 AND state = 'INGESTING'")
        .bind(id)
        .execute(tx, "marking a capture REJECTED")
        .await?;
    for (number, violation) in (0_i64..).zip(violations.iter().take(limits::VIOLATIONS)) {
        sql(
            "INSERT INTO capture_violations (capture, number, code, file, frame, field, message)
             VALUES ($1, $2, $3, $4, $5, $6, $7)",
        )
        .bind(id)
        .bind(number)
        .bind(&violation.code)
        .bind(&violation.file)
        .bind(violation.frame)
        .bind(&violation.field)
        .bind(&violation.message)
        .execute(tx, "recording a violation")
        .await?;
    }
    Ok(())
}
