//! Models, their identity slots, and their checkpoints.

use super::{
    requests,
    rows::{Columns, During, integer},
    subjects,
};
use crate::store::{Entry, NewModel, Page, RequestKey, StoreError, new_id};
use sqlx::{SqliteConnection, sqlite::SqliteRow};
use yoto_proto::{
    names::{self, Collection},
    v1::{Checkpoint, IdentitySlot, Model, ObjectRef, subject},
};

/// The variant with a single subject per model.
const SINGLE_SUBJECT_VARIANT: &str = "humannerf";

/// Creates a model, or returns the one that `request` created before.
pub async fn create(
    conn: &mut SqliteConnection,
    new: NewModel,
    request: Option<RequestKey>,
) -> Result<Model, StoreError> {
    if let Some(id) = requests::answered(conn, request.as_ref()).await? {
        return get(conn, &id).await;
    }
    let id = new_id();
    sqlx::query("INSERT INTO models (id, display_name, tier, variant) VALUES (?1, ?2, ?3, ?4)")
        .bind(&id)
        .bind(&new.display_name)
        .bind(&new.tier)
        .bind(&new.variant)
        .execute(&mut *conn)
        .await
        .during("creating a model")?;
    requests::remember(conn, request.as_ref(), &id).await?;
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
    Ok(Model {
        name: Collection::Models.name(&id),
        display_name: row.text("display_name")?,
        tier: row.text("tier")?,
        variant: row.text("variant")?,
        slots: slots.collect::<Result<_, StoreError>>()?,
        create_time: row.time("create_time")?,
    })
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
    Ok(match trained_slots(&row)? {
        slots if slots.is_empty() => Trained::All,
        slots => Trained::Slots(slots),
    })
}

/// The slots of a checkpoint's row; empty where it does not say.
fn trained_slots(row: &SqliteRow) -> Result<Vec<u32>, StoreError> {
    let text = row.maybe_text("slots")?.unwrap_or_default();
    let slots = text.split(',').filter(|slot| !slot.is_empty());
    let slots = slots.map(|slot| {
        slot.parse().map_err(|_| StoreError::Corrupt {
            what: "checkpoints.slots",
            detail: text.clone(),
        })
    });
    slots.collect()
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

/// Gives a READY subject the next slot, or returns its existing slot.
pub async fn add_identity(
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
            reason: "SUBJECT_NOT_READY",
            message: format!(
                "{} is {state}; only a READY subject gets a slot",
                subject.display_name
            ),
        });
    }
    if model.variant == SINGLE_SUBJECT_VARIANT && !model.slots.is_empty() {
        return Err(StoreError::Rule {
            reason: "MODEL_FULL",
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

/// The parts of a column that are separated by commas; none of NULL.
fn split(text: Option<String>) -> Vec<String> {
    let parts = text.iter().flat_map(|text| text.split(','));
    parts.map(str::to_owned).collect()
}

/// Takes a subject's slot away, which no checkpoint knows yet. Its number is not used again.
pub async fn remove_identity(
    conn: &mut SqliteConnection,
    model_id: &str,
    subject_id: &str,
) -> Result<Model, StoreError> {
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
            reason: "SLOT_TRAINED",
            message: format!(
                "{} was trained with {person}: only an untrained slot is removed",
                model.display_name
            ),
        });
    }
    let waiting = sqlx::query(
        "SELECT id FROM jobs WHERE model = ?1 AND state IN ('QUEUED', 'RUNNING') ORDER BY ord LIMIT 1",
    )
    .bind(model_id)
    .fetch_optional(&mut *conn)
    .await
    .during("looking for jobs of a model")?;
    if let Some(job) = waiting {
        let job = Collection::Jobs.name(&job.text("id")?);
        return Err(StoreError::Rule {
            reason: "MODEL_BUSY",
            message: format!(
                "{job} uses {}: wait for it, or cancel it",
                model.display_name
            ),
        });
    }
    sqlx::query("DELETE FROM slots WHERE model = ?1 AND subject = ?2")
        .bind(model_id)
        .bind(subject_id)
        .execute(&mut *conn)
        .await
        .during("removing a slot")?;
    get(conn, model_id).await
}

/// Checkpoints of a model, newest first.
pub async fn checkpoints(
    conn: &mut SqliteConnection,
    model_id: &str,
    limit: u32,
) -> Result<Vec<Checkpoint>, StoreError> {
    let model = get(conn, model_id).await?;
    let rows =
        sqlx::query("SELECT * FROM checkpoints WHERE model = ?1 ORDER BY step DESC LIMIT ?2")
            .bind(model_id)
            .bind(limit)
            .fetch_all(conn)
            .await
            .during("listing checkpoints")?;
    rows.iter()
        .map(|row| {
            let step = row.number("step")?;
            Ok(Checkpoint {
                name: names::checkpoint(&model.name, step),
                step,
                manifest: row.object("manifest_key", "manifest_bytes", "manifest_sha256")?,
                bytes: row.number("bytes")?,
                psnr: row.real("psnr")?,
                create_time: row.time("create_time")?,
                tradeoff: row.object("tradeoff_key", "tradeoff_bytes", "tradeoff_sha256")?,
                slots: trained_slots(row)?,
                image_size: row.maybe_number("image_size")?.unwrap_or_default(),
                shards: split(row.maybe_text("shards")?),
                best: false,
            })
        })
        .collect()
}

/// Stores the measured trade-off of a checkpoint, replacing an earlier one.
pub async fn record_tradeoff(
    conn: &mut SqliteConnection,
    checkpoint: &str,
    object: &ObjectRef,
) -> Result<(), StoreError> {
    let unreadable = |error: names::NameError| StoreError::Corrupt {
        what: "result.evaluate.checkpoint",
        detail: error.to_string(),
    };
    let (model_id, step) = names::parse_checkpoint(checkpoint).map_err(unreadable)?;
    let done = sqlx::query(
        "UPDATE checkpoints SET tradeoff_key = ?3, tradeoff_bytes = ?4, tradeoff_sha256 = ?5
         WHERE model = ?1 AND step = ?2",
    )
    .bind(model_id)
    .bind(integer("checkpoint.step", step)?)
    .bind(&object.key)
    .bind(integer("result.evaluate.tradeoff.bytes", object.bytes)?)
    .bind(&object.sha256)
    .execute(conn)
    .await
    .during("storing a trade-off")?;
    if done.rows_affected() == 0 {
        let name = checkpoint.to_owned();
        return Err(StoreError::NotFound { name });
    }
    Ok(())
}

/// Records a checkpoint. One of the same step, left by an earlier lease, is replaced.
pub async fn record_checkpoint(
    conn: &mut SqliteConnection,
    model_id: &str,
    job_id: &str,
    checkpoint: Checkpoint,
) -> Result<(), StoreError> {
    let manifest = checkpoint.manifest.unwrap_or_default();
    let slots: Vec<String> = checkpoint.slots.iter().map(u32::to_string).collect();
    let slots = slots.join(",");
    sqlx::query(
        "INSERT OR REPLACE INTO checkpoints
             (model, step, job, manifest_key, manifest_bytes, manifest_sha256, bytes, psnr, slots,
              image_size, shards)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11)",
    )
    .bind(model_id)
    .bind(integer("checkpoint.step", checkpoint.step)?)
    .bind(job_id)
    .bind(manifest.key)
    .bind(integer("checkpoint.manifest.bytes", manifest.bytes)?)
    .bind(manifest.sha256)
    .bind(integer("checkpoint.bytes", checkpoint.bytes)?)
    .bind(checkpoint.psnr)
    .bind((!slots.is_empty()).then_some(slots))
    .bind(checkpoint.image_size)
    .bind((!checkpoint.shards.is_empty()).then(|| checkpoint.shards.join(",")))
    .execute(conn)
    .await
    .during("recording a checkpoint")?;
    Ok(())
}
