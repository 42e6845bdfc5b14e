//! Models, their identity slots, and their checkpoints.

use super::{checkpoints, erasures, pins, requests, subjects};
use crate::db::{Lock, Row, Tx, sql};
use crate::rules::etag;
use crate::rules::retention::Retention;
use crate::{Entry, NewModel, Page, RequestKey, StoreError, Tenant, new_id};
use yoto_proto::names::Collection;
use yoto_proto::v1::{self, ErrorReason, IdentitySlot, Model, subject};

/// The variant with a single subject per model.
const SINGLE_SUBJECT_VARIANT: &str = "humannerf";

/// Creates a model, or returns the one that `request` created before.
pub async fn create(
    tx: &mut Tx,
    tenant: &Tenant,
    new: NewModel,
    request: Option<RequestKey>,
) -> Result<Model, StoreError> {
    if let Some(id) = requests::begin(tx, tenant, request.as_ref()).await? {
        return get(tx, tenant, &id).await;
    }
    let id = new_id();
    sql(
        "INSERT INTO models (id, display_name, tier, variant, keep_newest, keep_every, create_time, tenant)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8)",
    )
    .bind(&id)
    .bind(&new.display_name)
    .bind(&new.tier)
    .bind(&new.variant)
    .bind(new.retention.newest)
    .bind(new.retention.every)
    .bind(tx.now())
    .bind(tenant.id())
    .execute(tx, "creating a model").await?;
    requests::remember(tx, tenant, request.as_ref(), &id).await?;
    get(tx, tenant, &id).await
}

async fn read(tx: &mut Tx, row: &Row) -> Result<Model, StoreError> {
    let id = row.text("id")?;
    let slots = sql("SELECT slot, subject FROM slots WHERE model = $1 ORDER BY slot")
        .bind(&id)
        .rows(tx, "reading a model's slots")
        .await?;
    let trained = trained(tx, &id).await?;
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

/// Changes which checkpoints a model keeps, if its version is `asked` (empty: any), and removes the others.
pub async fn set_retention(
    tx: &mut Tx,
    tenant: &Tenant,
    id: &str,
    retention: &v1::Retention,
    default: Retention,
    asked: &str,
) -> Result<Model, StoreError> {
    tx.lock(Lock::Model(id)).await?;
    let before = get(tx, tenant, id).await?;
    etag::check(&before.display_name, asked, &before.etag)?;
    sql("UPDATE models SET keep_newest = $2, keep_every = $3 WHERE id = $1")
        .bind(id)
        .bind(retention.newest)
        .bind(retention.every)
        .execute(tx, "changing which checkpoints a model keeps")
        .await?;
    checkpoints::thin_out(tx, id, default).await?;
    get(tx, tenant, id).await
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

async fn trained(tx: &mut Tx, model_id: &str) -> Result<Trained, StoreError> {
    let row = sql("SELECT slots FROM checkpoints WHERE model = $1 ORDER BY step DESC LIMIT 1")
        .bind(model_id)
        .row(tx, "reading the newest checkpoint's slots")
        .await?;
    let Some(row) = row else {
        return Ok(Trained::None);
    };
    Ok(match checkpoints::trained_slots(&row)? {
        slots if slots.is_empty() => Trained::All,
        slots => Trained::Slots(slots),
    })
}

/// A model by id.
pub async fn get(tx: &mut Tx, tenant: &Tenant, id: &str) -> Result<Model, StoreError> {
    let row = sql("SELECT * FROM models WHERE id = $1 AND tenant = $2")
        .bind(id)
        .bind(tenant.id())
        .row(tx, "reading a model")
        .await?;
    match row {
        Some(row) => read(tx, &row).await,
        None => Err(StoreError::NotFound {
            name: Collection::Models.name(id),
        }),
    }
}

/// Models, oldest first.
pub async fn list(
    tx: &mut Tx,
    tenant: &Tenant,
    page: Page,
) -> Result<Vec<Entry<Model>>, StoreError> {
    let rows = sql("SELECT * FROM models WHERE tenant = $3 AND ord > $1 ORDER BY ord LIMIT $2")
        .bind(page.after.unwrap_or(0))
        .bind(page.limit)
        .bind(tenant.id())
        .rows(tx, "listing models")
        .await?;
    let mut entries = Vec::with_capacity(rows.len());
    for row in &rows {
        entries.push(Entry {
            position: row.number("ord")?,
            item: read(tx, row).await?,
        });
    }
    Ok(entries)
}

/// Gives a READY subject the next slot, or returns its existing slot, or repeats the answer to `request`: a
/// slot that was removed since then is not created again.
pub async fn add_identity(
    tx: &mut Tx,
    tenant: &Tenant,
    model_id: &str,
    subject_id: &str,
    request: Option<RequestKey>,
) -> Result<IdentitySlot, StoreError> {
    if let Some(slot) = requests::begin(tx, tenant, request.as_ref()).await? {
        return Ok(IdentitySlot {
            slot: slot.parse().map_err(|_| StoreError::Corrupt {
                what: "request_ids.answer",
                detail: slot,
            })?,
            subject: Collection::Subjects.name(subject_id),
            trained: false,
        });
    }
    let slot = next_identity(tx, tenant, model_id, subject_id).await?;
    requests::remember(tx, tenant, request.as_ref(), &slot.slot.to_string()).await?;
    Ok(slot)
}

async fn next_identity(
    tx: &mut Tx,
    tenant: &Tenant,
    model_id: &str,
    subject_id: &str,
) -> Result<IdentitySlot, StoreError> {
    tx.lock(Lock::Model(model_id)).await?;
    tx.lock(Lock::Subject(subject_id)).await?;
    let model = get(tx, tenant, model_id).await?;
    let subject = subjects::get(tx, tenant, subject_id).await?;
    if let Some(slot) = model.slots.iter().find(|slot| slot.subject == subject.name) {
        return Ok(slot.clone());
    }
    erasures::refuse_if_begun(tx, subject_id).await?;
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
    let slot = fill_slot(tx, model_id, subject_id).await?;
    Ok(IdentitySlot {
        slot,
        subject: subject.name,
        trained: false,
    })
}

/// Gives a subject the next slot.
pub(super) async fn fill_slot(
    tx: &mut Tx,
    model_id: &str,
    subject_id: &str,
) -> Result<u32, StoreError> {
    let row = sql(
        "UPDATE models SET next_slot = next_slot + 1 WHERE id = $1 RETURNING next_slot - 1 AS slot",
    )
    .bind(model_id)
    .one(tx, "taking the next slot")
    .await?;
    let slot: u32 = row.number("slot")?;
    sql("INSERT INTO slots (model, slot, subject) VALUES ($1, $2, $3)")
        .bind(model_id)
        .bind(slot)
        .bind(subject_id)
        .execute(tx, "filling a slot")
        .await?;
    Ok(slot)
}

/// Removes a subject's slot that no checkpoint was trained with. Its number is not used again.
pub async fn remove_identity(
    tx: &mut Tx,
    tenant: &Tenant,
    model_id: &str,
    subject_id: &str,
    request: Option<RequestKey>,
) -> Result<Model, StoreError> {
    if requests::begin(tx, tenant, request.as_ref())
        .await?
        .is_some()
    {
        return get(tx, tenant, model_id).await;
    }
    tx.lock(Lock::Model(model_id)).await?;
    let model = get(tx, tenant, model_id).await?;
    let name = Collection::Subjects.name(subject_id);
    let Some(slot) = model.slots.iter().find(|slot| slot.subject == name) else {
        return Err(StoreError::NotFound {
            name: format!("a slot of {name} in {}", model.name),
        });
    };
    if slot.trained {
        let person = subjects::get(tx, tenant, subject_id).await?.display_name;
        return Err(StoreError::Rule {
            reason: ErrorReason::SlotTrained,
            message: format!(
                "{} was trained with {person}: only an untrained slot is removed",
                model.display_name
            ),
        });
    }
    pins::ensure_idle(tx, &model).await?;
    sql("DELETE FROM slots WHERE model = $1 AND subject = $2")
        .bind(model_id)
        .bind(subject_id)
        .execute(tx, "removing a slot")
        .await?;
    requests::remember(tx, tenant, request.as_ref(), model_id).await?;
    get(tx, tenant, model_id).await
}
