//! Checkpoints of models: recorded, listed, thinned out.

use super::{garbage, models, pins};
use crate::db::{Lock, Row, Tx, integer, sql};
use crate::rules::etag;
use crate::rules::retention::{self, Published, Retention};
use crate::{StoreError, Tenant};
use std::collections::HashMap;
use yoto_proto::keys;
use yoto_proto::names::{self, Collection};
use yoto_proto::v1::{Checkpoint, ObjectRef};

/// The aliases of a checkpoint `c`, with commas between them.
macro_rules! aliases {
    () => {
        "(SELECT string_agg(a.alias, ',' ORDER BY a.alias) FROM checkpoint_aliases a
              WHERE a.model = c.model AND a.step = c.step) AS aliases"
    };
}

/// Checkpoints of a model, newest first.
pub(crate) async fn list(
    tx: &mut Tx,
    tenant: &Tenant,
    model_id: &str,
    limit: u32,
) -> Result<Vec<Checkpoint>, StoreError> {
    let rows = sql(concat!(
        "SELECT c.*, ",
        aliases!(),
        " FROM checkpoints c JOIN models m ON m.id = c.model
         WHERE c.model = $1 AND m.tenant = $2 ORDER BY c.step DESC LIMIT $3"
    ))
    .bind(model_id)
    .bind(tenant.id())
    .bind(limit)
    .rows(tx, "listing checkpoints")
    .await?;
    if rows.is_empty() {
        // A model that does not exist has no empty list.
        models::require(tx, tenant, model_id).await?;
    }
    let model = Collection::Models.name(model_id);
    rows.iter().map(|row| read(&model, row)).collect()
}

/// The checkpoints of several models of the tenant, newest first, by the models' ids.
pub(crate) async fn of_models(
    tx: &mut Tx,
    tenant: &Tenant,
    models: &[&str],
) -> Result<HashMap<String, Vec<Checkpoint>>, StoreError> {
    let mut found: HashMap<String, Vec<Checkpoint>> = HashMap::new();
    if models.is_empty() {
        return Ok(found);
    }
    let mut query = sql(concat!(
        "SELECT c.*, ",
        aliases!(),
        " FROM checkpoints c JOIN models m ON m.id = c.model WHERE m.tenant = $1 AND c.model IN ("
    ))
    .bind(tenant.id());
    query.push_all(models.iter().copied());
    query.push(") ORDER BY c.step DESC");
    for row in query.rows(tx, "listing the checkpoints of models").await? {
        let model = row.text("model")?;
        let checkpoint = read(&Collection::Models.name(&model), &row)?;
        found.entry(model).or_default().push(checkpoint);
    }
    Ok(found)
}

fn read(model: &str, row: &Row) -> Result<Checkpoint, StoreError> {
    let step = row.number("step")?;
    let mut checkpoint = Checkpoint {
        name: names::checkpoint(model, step),
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
        kept_for: Vec::new(),
        etag: String::new(),
        aliases: split(row.maybe_text("aliases")?),
    };
    checkpoint.etag = etag::of(&checkpoint);
    Ok(checkpoint)
}

/// The slots in a checkpoint's row; empty if it has none recorded.
pub(crate) fn trained_slots(row: &Row) -> Result<Vec<u32>, StoreError> {
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

/// The comma-separated parts of a column; empty for NULL.
fn split(text: Option<String>) -> Vec<String> {
    let parts = text.iter().flat_map(|text| text.split(','));
    parts.map(str::to_owned).collect()
}

/// All checkpoints of a model with their numbers, newest first, and the reasons to keep each; none if the model is not that of
/// `tenant`, where one asks.
async fn judged(
    tx: &mut Tx,
    tenant: Option<&Tenant>,
    model_id: &str,
    default: Retention,
) -> Result<Vec<(Checkpoint, Vec<String>)>, StoreError> {
    let rows = sql(concat!(
        "SELECT c.*, m.keep_newest, m.keep_every, ",
        aliases!(),
        " FROM checkpoints c JOIN models m ON m.id = c.model
         WHERE c.model = $1 AND ($2 IS NULL OR m.tenant = $2) ORDER BY c.step DESC"
    ))
    .bind(model_id)
    .bind(tenant.map(Tenant::id))
    .rows(tx, "listing checkpoints")
    .await?;
    let Some(first) = rows.first() else {
        return Ok(Vec::new());
    };
    let rule = Retention {
        newest: first.maybe_number("keep_newest")?.unwrap_or(default.newest),
        every: first.maybe_number("keep_every")?.unwrap_or(default.every),
    };
    let model = Collection::Models.name(model_id);
    let mut all = Vec::with_capacity(rows.len());
    for row in &rows {
        all.push(Published {
            checkpoint: read(&model, row)?,
            number: row.number("number")?,
        });
    }
    let reasons = retention::reasons(&all, rule, &pins::of_model(tx, model_id).await?);
    Ok(all
        .into_iter()
        .map(|it| it.checkpoint)
        .zip(reasons)
        .collect())
}

/// All checkpoints of a model, newest first, with the reasons to keep each.
pub(crate) async fn explained(
    tx: &mut Tx,
    tenant: &Tenant,
    model_id: &str,
    default: Retention,
) -> Result<Vec<Checkpoint>, StoreError> {
    let judged = judged(tx, Some(tenant), model_id, default).await?;
    if judged.is_empty() {
        // A model that does not exist has no empty list.
        models::require(tx, tenant, model_id).await?;
    }
    let explained = judged
        .into_iter()
        .map(|(it, kept_for)| Checkpoint { kept_for, ..it });
    Ok(explained.collect())
}

/// Removes the checkpoints that a model does not keep.
pub(crate) async fn thin_out(
    tx: &mut Tx,
    model_id: &str,
    default: Retention,
) -> Result<(), StoreError> {
    for (checkpoint, reasons) in judged(tx, None, model_id, default).await? {
        if reasons.is_empty() {
            remove(tx, model_id, checkpoint.step).await?;
        }
    }
    Ok(())
}

/// Removes a checkpoint, and notes its objects as garbage. Returns whether there was one.
pub(crate) async fn remove(tx: &mut Tx, model_id: &str, step: u64) -> Result<bool, StoreError> {
    let row = sql("DELETE FROM checkpoints WHERE model = $1 AND step = $2 RETURNING manifest_key")
        .bind(model_id)
        .bind(integer("checkpoint.step", step)?)
        .row(tx, "removing a checkpoint")
        .await?;
    let Some(row) = row else {
        return Ok(false);
    };
    garbage::deleted(tx, keys::folder(&row.text("manifest_key")?)).await?;
    Ok(true)
}

/// Stores the measured trade-off of a checkpoint, replacing an earlier one.
pub(crate) async fn record_tradeoff(
    tx: &mut Tx,
    tenant: &Tenant,
    checkpoint: &str,
    object: &ObjectRef,
) -> Result<(), StoreError> {
    let unreadable = |error: names::NameError| StoreError::Corrupt {
        what: "result.evaluate.checkpoint",
        detail: error.to_string(),
    };
    let (model_id, step) = names::parse_checkpoint(checkpoint).map_err(unreadable)?;
    tx.lock(Lock::Model(model_id)).await?;
    let done = sql(
        "UPDATE checkpoints SET tradeoff_key = $3, tradeoff_bytes = $4, tradeoff_sha256 = $5
         WHERE model IN (SELECT id FROM models WHERE id = $1 AND tenant = $6) AND step = $2",
    )
    .bind(model_id)
    .bind(integer("checkpoint.step", step)?)
    .bind(&object.key)
    .bind(integer("result.evaluate.tradeoff.bytes", object.bytes)?)
    .bind(&object.sha256)
    .bind(tenant.id())
    .execute(tx, "storing a trade-off")
    .await?;
    if done == 0 {
        let name = checkpoint.to_owned();
        return Err(StoreError::NotFound { name });
    }
    Ok(())
}

/// Records a checkpoint. One of the same step, left by an earlier lease, is replaced. A repeated call
/// changes nothing; after the checkpoint was removed it would bring back a row without objects.
pub(crate) async fn record(
    tx: &mut Tx,
    model_id: &str,
    job_id: &str,
    checkpoint: Checkpoint,
) -> Result<(), StoreError> {
    let manifest = checkpoint.manifest.unwrap_or_default();
    let folder = keys::folder(&manifest.key).to_owned();
    if garbage::is_deleted(tx, &folder).await? {
        return Ok(());
    }
    let step = integer("checkpoint.step", checkpoint.step)?;
    let number = match earlier(tx, model_id, step).await? {
        Some(row) => {
            let key = row.text("manifest_key")?;
            if key == manifest.key && row.text("manifest_sha256")? == manifest.sha256 {
                return Ok(());
            }
            if key != manifest.key {
                garbage::deleted(tx, keys::folder(&key)).await?;
            }
            row.number("number")?
        }
        None => next_number(tx, model_id).await?,
    };
    let slots: Vec<String> = checkpoint.slots.iter().map(u32::to_string).collect();
    let slots = slots.join(",");
    sql(
        "INSERT INTO checkpoints
             (model, step, job, manifest_key, manifest_bytes, manifest_sha256, bytes, psnr, slots,
              image_size, shards, number, create_time)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13)
         ON CONFLICT (model, step) DO UPDATE SET job = excluded.job,
             manifest_key = excluded.manifest_key, manifest_bytes = excluded.manifest_bytes,
             manifest_sha256 = excluded.manifest_sha256, bytes = excluded.bytes, psnr = excluded.psnr,
             slots = excluded.slots, image_size = excluded.image_size, shards = excluded.shards,
             number = excluded.number, create_time = excluded.create_time,
             tradeoff_key = NULL, tradeoff_bytes = NULL, tradeoff_sha256 = NULL",
    )
    .bind(model_id)
    .bind(step)
    .bind(job_id)
    .bind(manifest.key)
    .bind(integer("checkpoint.manifest.bytes", manifest.bytes)?)
    .bind(manifest.sha256)
    .bind(integer("checkpoint.bytes", checkpoint.bytes)?)
    .bind(checkpoint.psnr)
    .bind((!slots.is_empty()).then_some(slots))
    .bind(checkpoint.image_size)
    .bind((!checkpoint.shards.is_empty()).then(|| checkpoint.shards.join(",")))
    .bind(number)
    .bind(tx.now())
    .execute(tx, "recording a checkpoint").await?;
    Ok(())
}

/// The row of the same step.
async fn earlier(tx: &mut Tx, model_id: &str, step: i64) -> Result<Option<Row>, StoreError> {
    sql(
        "SELECT manifest_key, manifest_sha256, number FROM checkpoints
         WHERE model = $1 AND step = $2",
    )
    .bind(model_id)
    .bind(step)
    .row(tx, "looking for a checkpoint of the same step")
    .await
}

/// Counts one more published checkpoint.
async fn next_number(tx: &mut Tx, model_id: &str) -> Result<i64, StoreError> {
    let row = sql("UPDATE models SET published = published + 1 WHERE id = $1 RETURNING published")
        .bind(model_id)
        .one(tx, "counting a checkpoint")
        .await?;
    row.number("published")
}
