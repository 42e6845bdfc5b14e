//! The identity slots of models, and whether the newest checkpoint of each knows them.

use super::checkpoints;
use crate::StoreError;
use crate::db::{Row, Tx, sql};
use std::collections::HashMap;
use yoto_proto::names::Collection;
use yoto_proto::v1::IdentitySlot;

/// The newest checkpoint `c` of the model of the slot `s`, and the columns by which [`is_trained`] judges.
macro_rules! newest_checkpoint {
    (columns) => {
        "c.step, c.slots"
    };
    (join) => {
        " LEFT JOIN checkpoints c ON c.model = s.model
              AND c.step = (SELECT max(n.step) FROM checkpoints n WHERE n.model = s.model) "
    };
}
pub(super) use newest_checkpoint;

/// The slots of each of these models, by the models' ids. A model without slots is missing. They are read at once, since a
/// page of models would otherwise ask the database for each.
pub(super) async fn of_models(
    tx: &mut Tx,
    models: &[String],
) -> Result<HashMap<String, Vec<IdentitySlot>>, StoreError> {
    let mut found: HashMap<String, Vec<IdentitySlot>> = HashMap::new();
    if models.is_empty() {
        return Ok(found);
    }
    let mut query = sql(concat!(
        "SELECT s.model, s.slot, s.subject, ",
        newest_checkpoint!(columns),
        " FROM slots s",
        newest_checkpoint!(join),
        "WHERE s.model IN ("
    ));
    query.push_all(models);
    query.push(") ORDER BY s.model, s.slot");
    for row in query.rows(tx, "reading the slots of models").await? {
        let slot = row.number("slot")?;
        let known = IdentitySlot {
            slot,
            subject: Collection::Subjects.name(&row.text("subject")?),
            trained: is_trained(&row, slot)?,
        };
        found.entry(row.text("model")?).or_default().push(known);
    }
    Ok(found)
}

/// Whether the checkpoint in a row was trained with a slot. A checkpoint of an earlier version does not say: it knows all.
pub(super) fn is_trained(row: &Row, slot: u32) -> Result<bool, StoreError> {
    if row.maybe_number::<u64>("step")?.is_none() {
        return Ok(false);
    }
    let slots = checkpoints::trained_slots(row)?;
    Ok(slots.is_empty() || slots.contains(&slot))
}
