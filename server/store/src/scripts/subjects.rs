//! Subjects, and the shard of each.

use super::{page, quotas, requests};
use crate::db::{Lock, Row, Tx, sql, state};
use crate::rules::etag;
use crate::{Entry, NewSubject, Page, RequestKey, StoreError, SubjectChange, Tenant, new_id};
use yoto_proto::names::Collection;
use yoto_proto::v1::{Subject, subject};
use yoto_proto::worker::v1::SubjectShard;

pub(super) fn read(row: &Row) -> Result<Subject, StoreError> {
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
pub(crate) async fn create(
    tx: &mut Tx,
    tenant: &Tenant,
    new: NewSubject,
    request: Option<RequestKey>,
) -> Result<Subject, StoreError> {
    if let Some(id) = requests::begin(tx, tenant, request.as_ref()).await? {
        return get(tx, tenant, &id).await;
    }
    quotas::admit_person(tx, tenant).await?;
    let id = new_id();
    sql("INSERT INTO subjects (id, display_name, consent_note, create_time, tenant) VALUES ($1, $2, $3, $4, $5)")
        .bind(&id)
        .bind(&new.display_name)
        .bind(&new.consent_note)
        .bind(tx.now())
        .bind(tenant.id())
        .execute(tx, "creating a subject").await?;
    requests::remember(tx, tenant, request.as_ref(), &id).await?;
    get(tx, tenant, &id).await
}

/// A subject by id.
pub(crate) async fn get(tx: &mut Tx, tenant: &Tenant, id: &str) -> Result<Subject, StoreError> {
    let row = sql("SELECT * FROM subject_catalogue WHERE id = $1 AND tenant = $2")
        .bind(id)
        .bind(tenant.id())
        .row(tx, "reading a subject")
        .await?;
    match row {
        Some(row) => read(&row),
        None => Err(StoreError::NotFound {
            name: Collection::Subjects.name(id),
        }),
    }
}

/// Changes a subject, if its version is `asked` (empty: any).
pub(crate) async fn update(
    tx: &mut Tx,
    tenant: &Tenant,
    id: &str,
    change: SubjectChange,
    asked: &str,
) -> Result<Subject, StoreError> {
    tx.lock(Lock::Subject(id)).await?;
    let before = get(tx, tenant, id).await?;
    etag::check(&before.display_name, asked, &before.etag)?;
    sql(
        "UPDATE subjects SET display_name = coalesce($2, display_name),
             consent_note = coalesce($3, consent_note) WHERE id = $1",
    )
    .bind(id)
    .bind(change.display_name)
    .bind(change.consent_note)
    .execute(tx, "changing a subject")
    .await?;
    get(tx, tenant, id).await
}

/// Subjects, oldest first.
pub(crate) async fn list(
    tx: &mut Tx,
    tenant: &Tenant,
    page: Page,
) -> Result<Vec<Entry<Subject>>, StoreError> {
    let rows =
        sql("SELECT * FROM subject_catalogue WHERE tenant = $3 AND ord > $1 ORDER BY ord LIMIT $2")
            .bind(page.after.unwrap_or(0))
            .bind(page.limit)
            .bind(tenant.id())
            .rows(tx, "listing subjects")
            .await?;
    page::entries(&rows, read)
}

/// The shard of the subject's newest READY capture.
pub(crate) async fn shard(
    tx: &mut Tx,
    tenant: &Tenant,
    id: &str,
) -> Result<Option<SubjectShard>, StoreError> {
    let row = sql(
        "SELECT c.id FROM captures c JOIN subjects s ON s.id = c.subject
         WHERE c.subject = $1 AND s.tenant = $2 AND c.state = 'READY' ORDER BY c.ord DESC LIMIT 1",
    )
    .bind(id)
    .bind(tenant.id())
    .row(tx, "looking up a subject's shard")
    .await?;
    match row {
        Some(row) => shard_of(tx, &row.text("id")?).await,
        None => Ok(None),
    }
}

/// The shard of a capture, if it is READY.
pub(crate) async fn shard_of(
    tx: &mut Tx,
    capture_id: &str,
) -> Result<Option<SubjectShard>, StoreError> {
    let row = sql(
        "SELECT s.id, s.display_name, c.shard_key, c.shard_bytes, c.shard_sha256, c.frames,
             c.first_frame, c.last_frame
         FROM captures c JOIN subjects s ON s.id = c.subject
         WHERE c.id = $1 AND c.state = 'READY'",
    )
    .bind(capture_id)
    .row(tx, "looking up a capture's shard")
    .await?;
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
