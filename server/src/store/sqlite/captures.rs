//! Captures, and the results of their ingest jobs.

use super::capture_objects;
use super::rows::{Columns, During, integer, state};
use crate::rules::etag;
use crate::store::{Entry, Page, StoreError, UploadedFile};
use sqlx::SqliteConnection;
use sqlx::sqlite::SqliteRow;
use yoto_proto::keys::{CHECK, THUMBNAIL};
use yoto_proto::limits;
use yoto_proto::names::{self, Collection};
use yoto_proto::v1::{Capture, IngestResult, Violation, capture};

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
             FROM captures c ",
            $rest
        )
    };
}

/// A capture by id.
pub async fn get(conn: &mut SqliteConnection, id: &str) -> Result<Capture, StoreError> {
    let row = sqlx::query(select_captures!("WHERE c.id = ?1"))
        .bind(id)
        .fetch_optional(&mut *conn)
        .await
        .during("reading a capture")?
        .ok_or_else(|| not_found(id))?;
    read(conn, &row).await
}

/// Captures of a person, or of all people, oldest first.
pub async fn list(
    conn: &mut SqliteConnection,
    page: Page,
    subject_id: Option<&str>,
) -> Result<Vec<Entry<Capture>>, StoreError> {
    let rows = sqlx::query(select_captures!(
        "WHERE c.ord > ?1 AND (?2 IS NULL OR c.subject = ?2) ORDER BY c.ord LIMIT ?3"
    ))
    .bind(page.after.unwrap_or(0))
    .bind(subject_id)
    .bind(page.limit)
    .fetch_all(&mut *conn)
    .await
    .during("listing captures")?;
    let mut captures = Vec::with_capacity(rows.len());
    for row in &rows {
        captures.push(Entry {
            position: row.number("ord")?,
            item: read(conn, row).await?,
        });
    }
    Ok(captures)
}

async fn read(conn: &mut SqliteConnection, row: &SqliteRow) -> Result<Capture, StoreError> {
    let id = &*row.text("id")?;
    let ingest_job = row.maybe_text("ingest_job")?;
    let name = Collection::Captures.name(id);
    let mut files = Vec::new();
    if row.text("state")? == capture::State::Ready.as_str_name() {
        files = capture_objects::list(conn, id).await?;
    }
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
        violations: violations(conn, id).await?,
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
pub fn subject_id(capture: &Capture) -> Result<&str, StoreError> {
    let id = Collection::Subjects.parse(&capture.subject);
    id.map_err(|error| StoreError::Corrupt {
        what: "captures.subject",
        detail: error.to_string(),
    })
}

async fn violations(conn: &mut SqliteConnection, id: &str) -> Result<Vec<Violation>, StoreError> {
    let rows = sqlx::query("SELECT * FROM capture_violations WHERE capture = ?1 ORDER BY number")
        .bind(id)
        .fetch_all(conn)
        .await
        .during("reading a capture's violations")?;
    rows.iter()
        .map(|row| {
            Ok(Violation {
                code: row.text("code")?,
                file: row.text("file")?,
                frame: row.maybe_number("frame")?,
                field: row.text("field")?,
                message: row.text("message")?,
            })
        })
        .collect()
}

/// The files of a capture, by path.
pub async fn files(conn: &mut SqliteConnection, id: &str) -> Result<Vec<UploadedFile>, StoreError> {
    let rows = sqlx::query(
        "SELECT path, bytes, sha256 FROM capture_files WHERE capture = ?1 ORDER BY path",
    )
    .bind(id)
    .fetch_all(conn)
    .await
    .during("listing a capture's files")?;
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
pub async fn accept(
    conn: &mut SqliteConnection,
    id: &str,
    result: &IngestResult,
) -> Result<(), StoreError> {
    let shard = result.shard.clone().unwrap_or_default();
    sqlx::query(
        "UPDATE captures SET state = 'READY', frames = ?2, width = ?3, height = ?4,
             shard_key = ?5, shard_bytes = ?6, shard_sha256 = ?7,
             first_frame = ?8, last_frame = ?9 WHERE id = ?1",
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
    .execute(&mut *conn)
    .await
    .during("marking a capture READY")?;
    capture_objects::record(conn, id, result).await
}

/// Marks a capture as UPLOADED: its ingest failed through no fault of its files, and can be repeated.
pub async fn put_back(conn: &mut SqliteConnection, id: &str) -> Result<(), StoreError> {
    sqlx::query("UPDATE captures SET state = 'UPLOADED' WHERE id = ?1")
        .bind(id)
        .execute(conn)
        .await
        .during("marking a capture UPLOADED")?;
    Ok(())
}

/// Marks a capture as REJECTED, with the reasons.
pub async fn reject(
    conn: &mut SqliteConnection,
    id: &str,
    violations: &[Violation],
) -> Result<(), StoreError> {
    sqlx::query("UPDATE captures SET state = 'REJECTED' WHERE id = ?1")
        .bind(id)
        .execute(&mut *conn)
        .await
        .during("marking a capture REJECTED")?;
    for (number, violation) in (0_i64..).zip(violations.iter().take(limits::VIOLATIONS)) {
        sqlx::query(
            "INSERT INTO capture_violations (capture, number, code, file, frame, field, message)
             VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)",
        )
        .bind(id)
        .bind(number)
        .bind(&violation.code)
        .bind(&violation.file)
        .bind(violation.frame)
        .bind(&violation.field)
        .bind(&violation.message)
        .execute(&mut *conn)
        .await
        .during("recording a violation")?;
    }
    Ok(())
}
