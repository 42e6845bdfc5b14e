//! Names that people give checkpoints. A model has one checkpoint of each name, which is kept as long as it has one.

use super::models;
use crate::db::{Lock, Tx, integer, sql};
use crate::{StoreError, Tenant};
use yoto_proto::names::{self, Collection};

/// Gives a checkpoint of the tenant's model an alias, which another one may lose.
pub(crate) async fn set(
    tx: &mut Tx,
    tenant: &Tenant,
    model_id: &str,
    step: u64,
    alias: &str,
) -> Result<(), StoreError> {
    tx.lock(Lock::Model(model_id)).await?;
    models::get(tx, tenant, model_id).await?;
    let done = sql("INSERT INTO checkpoint_aliases (model, alias, step)
             SELECT model, $3, step FROM checkpoints WHERE model = $1 AND step = $2
         ON CONFLICT (model, alias) DO UPDATE SET step = excluded.step")
    .bind(model_id)
    .bind(integer("checkpoint.step", step)?)
    .bind(alias)
    .execute(tx, "naming a checkpoint")
    .await?;
    match done {
        0 => Err(StoreError::NotFound {
            name: names::checkpoint(&Collection::Models.name(model_id), step),
        }),
        _ => Ok(()),
    }
}

/// Takes an alias away. Returns whether a checkpoint had it.
pub(crate) async fn remove(
    tx: &mut Tx,
    tenant: &Tenant,
    model_id: &str,
    alias: &str,
) -> Result<bool, StoreError> {
    tx.lock(Lock::Model(model_id)).await?;
    models::get(tx, tenant, model_id).await?;
    let done = sql("DELETE FROM checkpoint_aliases WHERE model = $1 AND alias = $2")
        .bind(model_id)
        .bind(alias)
        .execute(tx, "removing the name of a checkpoint")
        .await?;
    Ok(done > 0)
}

/// The step of the checkpoint with the alias.
pub(crate) async fn step(
    tx: &mut Tx,
    tenant: &Tenant,
    model_id: &str,
    alias: &str,
) -> Result<Option<u64>, StoreError> {
    let row = sql(
        "SELECT a.step FROM checkpoint_aliases a JOIN models m ON m.id = a.model
         WHERE a.model = $1 AND a.alias = $2 AND m.tenant = $3",
    )
    .bind(model_id)
    .bind(alias)
    .bind(tenant.id())
    .row(tx, "looking for the name of a checkpoint")
    .await?;
    row.map(|row| row.number("step")).transpose()
}
