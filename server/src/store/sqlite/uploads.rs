//! Uploads: captures that are still arriving. Each file has a number of committed bytes.

use super::rows::{Columns, During, integer};
use super::steps::age;
use super::{captures, garbage, jobs, requests};
use crate::store::{
    CommittedPart, NewJob, NewUpload, RequestKey, StoreError, Upload, UploadFile, new_id,
};
use sqlx::{QueryBuilder, Sqlite, SqliteConnection};
use yoto_proto::names::Collection;
use yoto_proto::v1::{Capture, ErrorReason, IngestSpec, JobSpec, job_spec};

/// Rows of one INSERT; SQLite allows 32,766 parameters in a statement.
const ROWS_PER_STATEMENT: usize = 4000;
/// The call that opens an upload, under which its request id is stored.
pub const CREATE: &str = "CreateUpload";

fn not_found(id: &str) -> StoreError {
    StoreError::NotFound {
        name: Collection::Uploads.name(id),
    }
}

/// Opens an upload, or returns the one that `request` opened before. Returns its id.
pub async fn create(
    conn: &mut SqliteConnection,
    new: NewUpload,
    request: Option<RequestKey>,
    now: f64,
) -> Result<String, StoreError> {
    if let Some(id) = requests::answered(conn, request.as_ref()).await? {
        return Ok(id);
    }
    let id = new_id();
    let done = sqlx::query(
        "INSERT INTO captures (id, subject, create_time, write_time)
             SELECT ?1, id, ?3, ?3 FROM subjects WHERE id = ?2",
    )
    .bind(&id)
    .bind(&new.subject_id)
    .bind(now)
    .execute(&mut *conn)
    .await
    .during("opening an upload")?;
    if done.rows_affected() == 0 {
        return Err(StoreError::NotFound {
            name: Collection::Subjects.name(&new.subject_id),
        });
    }
    for chunk in new.files.chunks(ROWS_PER_STATEMENT) {
        let mut rows = Vec::with_capacity(chunk.len());
        for file in chunk {
            rows.push((
                &file.path,
                integer("files.bytes", file.bytes)?,
                &file.sha256,
            ));
        }
        QueryBuilder::<Sqlite>::new("INSERT INTO capture_files (capture, path, bytes, sha256) ")
            .push_values(rows, |mut row, (path, bytes, sha256)| {
                row.push_bind(&id)
                    .push_bind(path)
                    .push_bind(bytes)
                    .push_bind(sha256);
            })
            .build()
            .execute(&mut *conn)
            .await
            .during("recording a capture's files")?;
    }
    requests::remember(conn, request.as_ref(), &id, now).await?;
    Ok(id)
}

/// An upload by id, finished or not.
pub async fn get(conn: &mut SqliteConnection, id: &str) -> Result<Upload, StoreError> {
    let row = sqlx::query("SELECT subject, state, write_time FROM captures WHERE id = ?1")
        .bind(id)
        .fetch_optional(&mut *conn)
        .await
        .during("reading an upload")?
        .ok_or_else(|| not_found(id))?;
    let files = sqlx::query(
        "SELECT path, bytes, sha256, committed FROM capture_files WHERE capture = ?1 ORDER BY path",
    )
    .bind(id)
    .fetch_all(conn)
    .await
    .during("listing an upload's files")?;
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
        write_time: row.real("write_time")?.unwrap_or_default(),
        files: files.collect::<Result<_, StoreError>>()?,
    })
}

/// Records what is on disk. Each part begins where the committed bytes of its file end.
pub async fn commit(
    conn: &mut SqliteConnection,
    id: &str,
    parts: &[CommittedPart],
    now: f64,
) -> Result<(), StoreError> {
    let done =
        sqlx::query("UPDATE captures SET write_time = ?2 WHERE id = ?1 AND state = 'UPLOADING'")
            .bind(id)
            .bind(now)
            .execute(&mut *conn)
            .await
            .during("noting the write of an upload")?;
    if done.rows_affected() == 0 {
        return Err(not_found(id));
    }
    for part in parts {
        let done = sqlx::query(
            "UPDATE capture_files SET committed = ?4
             WHERE capture = ?1 AND path = ?2 AND committed = ?3 AND ?4 <= bytes",
        )
        .bind(id)
        .bind(&part.path)
        .bind(integer("offset", part.from)?)
        .bind(integer("offset", part.to)?)
        .execute(&mut *conn)
        .await
        .during("committing a part of an upload")?;
        if done.rows_affected() == 0 {
            return Err(StoreError::Rule {
                reason: ErrorReason::UploadOffset,
                message: format!(
                    "{}: bytes {} to {} do not follow what was committed",
                    part.path, part.from, part.to
                ),
            });
        }
    }
    Ok(())
}

/// Forgets the bytes of a file whose checksum differs from the announced one.
pub async fn restart(conn: &mut SqliteConnection, id: &str, path: &str) -> Result<(), StoreError> {
    sqlx::query("UPDATE capture_files SET committed = 0 WHERE capture = ?1 AND path = ?2")
        .bind(id)
        .bind(path)
        .execute(conn)
        .await
        .during("starting a file of an upload anew")?;
    Ok(())
}

/// Ends an upload and queues its ingest job. One that has ended already is not changed.
pub async fn finish(
    conn: &mut SqliteConnection,
    id: &str,
    request: Option<RequestKey>,
    now: f64,
) -> Result<Capture, StoreError> {
    if requests::answered(conn, request.as_ref()).await?.is_some() {
        return captures::get(conn, id).await;
    }
    let done = sqlx::query(
        "UPDATE captures SET state = 'INGESTING' WHERE id = ?1 AND state = 'UPLOADING'
             AND NOT EXISTS (SELECT 1 FROM capture_files f WHERE f.capture = ?1 AND f.committed < f.bytes)",
    )
    .bind(id)
    .execute(&mut *conn)
    .await
    .during("ending an upload")?;
    if done.rows_affected() > 0 {
        ingest(conn, id, now).await?;
    } else if get(conn, id).await?.open {
        return Err(StoreError::Rule {
            reason: ErrorReason::UploadIncomplete,
            message: format!("{} is not complete", Collection::Uploads.name(id)),
        });
    }
    requests::remember(conn, request.as_ref(), id, now).await?;
    captures::get(conn, id).await
}

/// Queues an ingest job of the capture.
async fn ingest(conn: &mut SqliteConnection, id: &str, now: f64) -> Result<(), StoreError> {
    let ingest = IngestSpec {
        capture: Collection::Captures.name(id),
    };
    let spec = JobSpec {
        kind: Some(job_spec::Kind::Ingest(ingest)),
    };
    jobs::insert(conn, NewJob::normal(spec), now)
        .await
        .map(drop)
}

/// Queues another ingest job for a capture whose last one made no shard.
pub async fn ingest_again(
    conn: &mut SqliteConnection,
    id: &str,
    request: Option<RequestKey>,
    now: f64,
) -> Result<Capture, StoreError> {
    if requests::answered(conn, request.as_ref()).await?.is_some() {
        return captures::get(conn, id).await;
    }
    let before = captures::get(conn, id).await?;
    let done = sqlx::query(
        "UPDATE captures SET state = 'INGESTING' WHERE id = ?1 AND state IN ('UPLOADED', 'REJECTED')",
    )
    .bind(id)
    .execute(&mut *conn)
    .await
    .during("starting an ingest anew")?;
    if done.rows_affected() == 0 {
        return Err(StoreError::Rule {
            reason: ErrorReason::NotRepeatable,
            message: format!(
                "{} is {}: only one that is UPLOADED or REJECTED is read again",
                before.name,
                before.state().as_str_name()
            ),
        });
    }
    sqlx::query("DELETE FROM capture_violations WHERE capture = ?1")
        .bind(id)
        .execute(&mut *conn)
        .await
        .during("forgetting a capture's violations")?;
    ingest(conn, id, now).await?;
    requests::remember(conn, request.as_ref(), id, now).await?;
    captures::get(conn, id).await
}

/// Ends the uploads without a write for `idle` seconds. Returns their ids.
pub async fn expire(
    conn: &mut SqliteConnection,
    idle: f64,
    now: f64,
) -> Result<Vec<String>, StoreError> {
    let rows = sqlx::query(concat!(
        "DELETE FROM captures WHERE state = 'UPLOADING' AND ",
        age!("write_time"),
        " >= ?2 RETURNING id"
    ))
    .bind(now)
    .bind(idle)
    .fetch_all(&mut *conn)
    .await
    .during("ending idle uploads")?;
    let mut ended = Vec::with_capacity(rows.len());
    for row in &rows {
        let id = row.text("id")?;
        forget(conn, &id, now).await?;
        ended.push(id);
    }
    Ok(ended)
}

/// Notes the files of a removed upload as garbage, and frees its request id, so that the same files can be
/// uploaded again.
pub async fn forget(conn: &mut SqliteConnection, id: &str, now: f64) -> Result<(), StoreError> {
    garbage::deleted(conn, &format!("uploads/{id}"), now).await?;
    sqlx::query("DELETE FROM request_ids WHERE method = ?1 AND answer = ?2")
        .bind(CREATE)
        .bind(id)
        .execute(conn)
        .await
        .during("freeing a request id")?;
    Ok(())
}
