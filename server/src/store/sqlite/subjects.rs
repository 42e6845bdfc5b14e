//! Subjects, and the shard of each.

use super::requests;
use super::rows::{Columns, During, state};
use crate::rules::etag;
use crate::store::{Entry, NewSubject, Page, RequestKey, StoreError, SubjectChange, new_id};
use sqlx::SqliteConnection;
use sqlx::sqlite::SqliteRow;
use yoto_proto::names::Collection;
use yoto_proto::v1::{Subject, subject};
use yoto_proto::worker::v1::SubjectShard;

fn read(row: &SqliteRow) -> Result<Subject, StoreError> {
    let captures = row.maybe_text("captures")?.unwrap_or_default();
    let mut subject = Subject {
        name: Collection::Subjects.name(&row.text("id")?),
        display_name: row.text("display_name")?,
        state: state(
            "subjects.state",
            &row.text("state")?,
            subject::State::from_str_name,
        )? as i32,
        consent_note: row.text("consent_note")?,
        captures: captures
            .split(',')
            .filter(|id| !id.is_empty())
            .map(|id| Collection::Captures.name(id))
            .collect(),
        create_time: row.time("create_time")?,
        etag: String::new(),
    };
    subject.etag = etag::of(&subject);
    Ok(subject)
}

/// Creates a subject, or returns the one that `request` created before.
pub async fn create(
    conn: &mut SqliteConnection,
    new: NewSubject,
    request: Option<RequestKey>,
    now: f64,
) -> Result<Subject, StoreError> {
    if let Some(id) = requests::answered(conn, request.as_ref()).await? {
        return get(conn, &id).await;
    }
    let id = new_id();
    sqlx::query("INSERT INTO subjects (id, display_name, consent_note, create_time) VALUES (?1, ?2, ?3, ?4)")
        .bind(&id)
        .bind(&new.display_name)
        .bind(&new.consent_note)
        .bind(now)
        .execute(&mut *conn)
        .await
        .during("creating a subject")?;
    requests::remember(conn, request.as_ref(), &id, now).await?;
    get(conn, &id).await
}

/// A subject by id.
pub async fn get(conn: &mut SqliteConnection, id: &str) -> Result<Subject, StoreError> {
    let row = sqlx::query("SELECT * FROM subject_catalogue WHERE id = ?1")
        .bind(id)
        .fetch_optional(conn)
        .await
        .during("reading a subject")?;
    match row {
        Some(row) => read(&row),
        None => Err(StoreError::NotFound {
            name: Collection::Subjects.name(id),
        }),
    }
}

/// Changes a subject, if its version is `asked` (empty: any).
pub async fn update(
    conn: &mut SqliteConnection,
    id: &str,
    change: SubjectChange,
    asked: &str,
) -> Result<Subject, StoreError> {
    let before = get(conn, id).await?;
    etag::check(&before.display_name, asked, &before.etag)?;
    sqlx::query(
        "UPDATE subjects SET display_name = coalesce(?2, display_name),
             consent_note = coalesce(?3, consent_note) WHERE id = ?1",
    )
    .bind(id)
    .bind(change.display_name)
    .bind(change.consent_note)
    .execute(&mut *conn)
    .await
    .during("changing a subject")?;
    get(conn, id).await
}

/// Subjects, oldest first.
pub async fn list(
    conn: &mut SqliteConnection,
    page: Page,
) -> Result<Vec<Entry<Subject>>, StoreError> {
    let rows = sqlx::query("SELECT * FROM subject_catalogue WHERE ord > ?1 ORDER BY ord LIMIT ?2")
        .bind(page.after.unwrap_or(0))
        .bind(page.limit)
        .fetch_all(conn)
        .await
        .during("listing subjects")?;
    rows.iter()
        .map(|row| {
            Ok(Entry {
                position: row.number("ord")?,
                item: read(row)?,
            })
        })
        .collect()
}

/// The shard of the subject's newest READY capture.
pub async fn shard(
    conn: &mut SqliteConnection,
    id: &str,
) -> Result<Option<SubjectShard>, StoreError> {
    let row = sqlx::query(
        "SELECT id FROM captures WHERE subject = ?1 AND state = 'READY' ORDER BY ord DESC LIMIT 1",
    )
    .bind(id)
    .fetch_optional(&mut *conn)
    .await
    .during("looking up a subject's shard")?;
    match row {
        Some(row) => shard_of(conn, &row.text("id")?).await,
        None => Ok(None),
    }
}

/// The shard of a capture, if it is READY.
pub async fn shard_of(
    conn: &mut SqliteConnection,
    capture_id: &str,
) -> Result<Option<SubjectShard>, StoreError> {
    let row = sqlx::query(
        "SELECT s.id, s.display_name, c.shard_key, c.shard_bytes, c.shard_sha256, c.frames,
             c.first_frame, c.last_frame
         FROM captures c JOIN subjects s ON s.id = c.subject
         WHERE c.id = ?1 AND c.state = 'READY'",
    )
    .bind(capture_id)
    .fetch_optional(conn)
    .await
    .during("looking up a capture's shard")?;
    let Some(row) = row else {
        return Ok(None);
    };
    Ok(Some(SubjectShard {
        subject: Collection::Subjects.name(&row.text("id")?),
        display_name: row.text("display_name")?,
        shard: row.object("shard_key", "shard_bytes", "shard_sha256")?,
        frames: row.number("frames")?,
        first_frame: row.maybe_number("first_frame")?,
        last_frame: row.maybe_number("last_frame")?,
    }))
}
