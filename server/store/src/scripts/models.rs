//! Models, and who gets a slot in them.

use super::{checkpoints, erasures, pins, requests, slots, subjects};
use crate::db::{Lock, Row, Tx, sql};
use crate::rules::etag;
use crate::rules::retention::Retention;
use crate::{Entry, NewModel, Page, RequestKey, StoreError, Tenant, new_id};
use yoto_proto::names::Collection;
use yoto_proto::v1::{self, ErrorReason, IdentitySlot, Model, subject};

/// The variant with a single subject per model.
const SINGLE_SUBJECT_VARIANT: &str = "humannerf";

/// Creates a model, or returns the one that `request` created before.
pub(crate) async fn create(
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

/// Models with the slots of each.
async fn read(tx: &mut Tx, rows: &[Row]) -> Result<Vec<Model>, StoreError> {
    let ids = rows.iter().map(|row| row.text("id"));
    let ids = ids.collect::<Result<Vec<_>, StoreError>>()?;
    let mut slots = slots::of_models(tx, &ids).await?;
    let models = rows.iter().zip(ids).map(|(row, id)| {
        let mut model = Model {
            name: Collection::Models.name(&id),
            display_name: row.text("display_name")?,
            tier: row.text("tier")?,
            variant: row.text("variant")?,
            slots: slots.remove(&id).unwrap_or_default(),
            create_time: row.time("create_time")?,
            retention: Some(v1::Retention {
                newest: row.maybe_number("keep_newest")?,
                every: row.maybe_number("keep_every")?,
            }),
            etag: String::new(),
        };
        model.etag = etag::of(&model);
        Ok(model)
    });
    models.collect()
}

/// Changes which checkpoints a model keeps, if its version is `asked` (empty: any), and removes the others.
pub(crate) async fn set_retention(
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

/// A model by id.
pub(crate) async fn get(tx: &mut Tx, tenant: &Tenant, id: &str) -> Result<Model, StoreError> {
    let found = some(tx, tenant, &[id]).await?;
    found.into_iter().next().ok_or_else(|| not_found(id))
}

/// The tenant's models among those with these ids, oldest first.
pub(crate) async fn some(
    tx: &mut Tx,
    tenant: &Tenant,
    ids: &[&str],
) -> Result<Vec<Model>, StoreError> {
    if ids.is_empty() {
        return Ok(Vec::new());
    }
    let mut query = sql("SELECT * FROM models WHERE tenant = $1 AND id IN (").bind(tenant.id());
    query.push_all(ids.iter().copied());
    query.push(") ORDER BY ord");
    let rows = query.rows(tx, "reading models").await?;
    read(tx, &rows).await
}

/// Checks that the tenant has the model.
pub(crate) async fn require(tx: &mut Tx, tenant: &Tenant, id: &str) -> Result<(), StoreError> {
    let row = sql("SELECT EXISTS (SELECT 1 FROM models WHERE id = $1 AND tenant = $2) AS found")
        .bind(id)
        .bind(tenant.id())
        .one(tx, "looking for a model")
        .await?;
    match row.flag("found")? {
        true => Ok(()),
        false => Err(not_found(id)),
    }
}

fn not_found(id: &str) -> StoreError {
    StoreError::NotFound {
        name: Collection::Models.name(id),
    }
}

/// Models, oldest first.
pub(crate) async fn list(
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
    let models = read(tx, &rows).await?;
    let entries = rows.iter().zip(models).map(|(row, item)| {
        Ok(Entry {
            position: row.number("ord")?,
            item,
        })
    });
    entries.collect()
}

/// Gives a READY subject the next slot, or returns its existing slot, or repeats the answer to `request`: a
/// slot that was removed since then is not created again.
pub(crate) async fn add_identity(
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
pub(crate) async fn remove_identity(
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
