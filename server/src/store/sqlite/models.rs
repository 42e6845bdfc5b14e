//! Models, their identity slots, and their checkpoints.

use super::rows::{Columns, During};
use super::{checkpoints, pins, requests, subjects};
use crate::checkpoints::retention::Retention;
use crate::rules::etag;
use crate::store::{Entry, NewModel, Page, RequestKey, StoreError, new_id};
use sqlx::SqliteConnection;
use sqlx::sqlite::SqliteRow;
use yoto_proto::names::Collection;
use yoto_proto::v1::{self, ErrorReason, IdentitySlot, Model, subject};

/// The variant with a single subject per model.
const SINGLE_SUBJECT_VARIANT: &str = "humannerf";

/// Creates a model, or returns the one that `request` created before.
pub async fn create(
    conn: &mut SqliteConnection,
    new: NewModel,
    request: Option<RequestKey>,
    now: f64,
) -> Result<Model, StoreError> {
    if let Some(id) = requests::answered(conn, request.as_ref()).await? {
        return get(conn, &id).await;
    }
    let id = new_id();
    sqlx::query(
        "INSERT INTO models (id, display_name, tier, variant, keep_newest, keep_every, create_time)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)",
    )
    .bind(&id)
    .bind(&new.display_name)
    .bind(&new.tier)
    .bind(&new.variant)
    .bind(new.retention.newest)
    .bind(new.retention.every)
    .bind(now)
    .execute(&mut *conn)
    .await
    .during("creating a model")?;
    requests::remember(conn, request.as_ref(), &id, now).await?;
    get(conn, &id).await
}

async fn read(conn: &mut SqliteConnection, row: &SqliteRow) -> Result<Model, StoreError> {
    let id = row.text("id")?;
    let slots = sqlx::query("SELECT slot, subject FROM slots WHERE model = ?1 ORDER BY slot")
        .bind(&id)
        .fetch_all(&mut *conn)
        .await
        .during("reading a model's slots")?;
    let trained = trained(&mut *conn, &id).await?;
    let slots = slots.iter().map(|row| {
        let slot = row.number("slot")?;
        Ok(IdentitySlot {
            slot,
            subject: Collection::Subjects.name(&row.text("subject")?),
            trained: trained.knows(slot),
        })
    });
    let mut model = Model {
        name: Collection::Models.name(&id),
        display_name: row.text("display_name")?,
        tier: row.text("tier")?,
        variant: row.text("variant")?,
        slots: slots.collect::<Result<_, StoreError>>()?,
        create_time: row.time("create_time")?,
        retention: Some(v1::Retention {
            newest: row.maybe_number("keep_newest")?,
            every: row.maybe_number("keep_every")?,
        }),
        etag: String::new(),
    };
    model.etag = etag::of(&model);
    Ok(model)
}

/// Changes which checkpoints a model keeps, and removes the others.
pub async fn set_retention(
    conn: &mut SqliteConnection,
    id: &str,
    retention: &v1::Retention,
    default: Retention,
    now: f64,
) -> Result<Model, StoreError> {
    get(conn, id).await?;
    sqlx::query("UPDATE models SET keep_newest = ?2, keep_every = ?3 WHERE id = ?1")
        .bind(id)
        .bind(retention.newest)
        .bind(retention.every)
        .execute(&mut *conn)
        .await
        .during("changing which checkpoints a model keeps")?;
    checkpoints::thin_out(conn, id, default, now).await?;
    get(conn, id).await
}

/// Slots that the newest checkpoint of a model was trained with.
enum Trained {
    /// There is no checkpoint.
    None,
    /// A checkpoint of an earlier version does not say.
    All,
    Slots(Vec<u32>),
}

impl Trained {
    fn knows(&self, slot: u32) -> bool {
        match self {
            Self::None => false,
            Self::All => true,
            Self::Slots(slots) => slots.contains(&slot),
        }
    }
}

async fn trained(conn: &mut SqliteConnection, model_id: &str) -> Result<Trained, StoreError> {
    let row =
        sqlx::query("SELECT slots FROM checkpoints WHERE model = ?1 ORDER BY step DESC LIMIT 1")
            .bind(model_id)
            .fetch_optional(conn)
            .await
            .during("reading the newest checkpoint's slots")?;
    let Some(row) = row else {
        return Ok(Trained::None);
    };
    Ok(match checkpoints::trained_slots(&row)? {
        slots if slots.is_empty() => Trained::All,
        slots => Trained::Slots(slots),
    })
}

/// A model by id.
pub async fn get(conn: &mut SqliteConnection, id: &str) -> Result<Model, StoreError> {
    let row = sqlx::query("SELECT * FROM models WHERE id = ?1")
        .bind(id)
        .fetch_optional(&mut *conn)
        .await
        .during("reading a model")?;
    match row {
        Some(row) => read(conn, &row).await,
        None => Err(StoreError::NotFound {
            name: Collection::Models.name(id),
        }),
    }
}

/// Models, oldest first.
pub async fn list(
    conn: &mut SqliteConnection,
    page: Page,
) -> Result<Vec<Entry<Model>>, StoreError> {
    let rows = sqlx::query("SELECT * FROM models WHERE ord > ?1 ORDER BY ord LIMIT ?2")
        .bind(page.after.unwrap_or(0))
        .bind(page.limit)
        .fetch_all(&mut *conn)
        .await
        .during("listing models")?;
    let mut entries = Vec::with_capacity(rows.len());
    for row in &rows {
        entries.push(Entry {
            position: row.number("ord")?,
            item: read(conn, row).await?,
        });
    }
    Ok(entries)
}

/// Gives a READY subject the next slot, or returns its existing slot, or repeats the answer to `request`: a
/// slot that was removed since then is not created again.
pub async fn add_identity(
    conn: &mut SqliteConnection,
    model_id: &str,
    subject_id: &str,
    request: Option<RequestKey>,
    now: f64,
) -> Result<IdentitySlot, StoreError> {
    if let Some(slot) = requests::answered(conn, request.as_ref()).await? {
        return Ok(IdentitySlot {
            slot: slot.parse().map_err(|_| StoreError::Corrupt {
                what: "request_ids.answer",
                detail: slot,
            })?,
            subject: Collection::Subjects.name(subject_id),
            trained: false,
        });
    }
    let slot = next_identity(conn, model_id, subject_id).await?;
    requests::remember(conn, request.as_ref(), &slot.slot.to_string(), now).await?;
    Ok(slot)
}

async fn next_identity(
    conn: &mut SqliteConnection,
    model_id: &str,
    subject_id: &str,
) -> Result<IdentitySlot, StoreError> {
    let model = get(conn, model_id).await?;
    let subject = subjects::get(conn, subject_id).await?;
    if let Some(slot) = model.slots.iter().find(|slot| slot.subject == subject.name) {
        return Ok(slot.clone());
    }
    if subject.state() != subject::State::Ready {
        let state = subject.state().as_str_name();
        return Err(StoreError::Rule {
            reason: ErrorReason::SubjectNotReady,
            message: format!(
                "{} is {state}; only a READY subject gets a slot",
                subject.display_name
            ),
        });
    }
    if model.variant == SINGLE_SUBJECT_VARIANT && !model.slots.is_empty() {
        return Err(StoreError::Rule {
            reason: ErrorReason::ModelFull,
            message: format!(
                "{} has the variant {SINGLE_SUBJECT_VARIANT}, which is limited to one subject, and has one",
                model.display_name
            ),
        });
    }
    let row = sqlx::query(
        "UPDATE models SET next_slot = next_slot + 1 WHERE id = ?1 RETURNING next_slot - 1 AS slot",
    )
    .bind(model_id)
    .fetch_one(&mut *conn)
    .await
    .during("taking the next slot")?;
    let slot: u32 = row.number("slot")?;
    sqlx::query("INSERT INTO slots (model, slot, subject) VALUES (?1, ?2, ?3)")
        .bind(model_id)
        .bind(slot)
        .bind(subject_id)
        .execute(conn)
        .await
        .during("filling a slot")?;
    Ok(IdentitySlot {
        slot,
        subject: subject.name,
        trained: false,
    })
}

/// Removes a subject's slot that no checkpoint was trained with. Its number is not used again.
pub async fn remove_identity(
    conn: &mut SqliteConnection,
    model_id: &str,
    subject_id: &str,
    request: Option<RequestKey>,
    now: f64,
) -> Result<Model, StoreError> {
    if requests::answered(conn, request.as_ref()).await?.is_some() {
        return get(conn, model_id).await;
    }
    let model = get(conn, model_id).await?;
    let name = Collection::Subjects.name(subject_id);
    let Some(slot) = model.slots.iter().find(|slot| slot.subject == name) else {
        return Err(StoreError::NotFound {
            name: format!("a slot of {name} in {}", model.name),
        });
    };
    if slot.trained {
        let person = subjects::get(conn, subject_id).await?.display_name;
        return Err(StoreError::Rule {
            reason: ErrorReason::SlotTrained,
            message: format!(
                "{} was trained with {person}: only an untrained slot is removed",
                model.display_name
            ),
        });
    }
    pins::ensure_idle(conn, &model).await?;
    sqlx::query("DELETE FROM slots WHERE model = ?1 AND subject = ?2")
        .bind(model_id)
        .bind(subject_id)
        .execute(&mut *conn)
        .await
        .during("removing a slot")?;
    requests::remember(conn, request.as_ref(), model_id, now).await?;
    get(conn, model_id).await
}
