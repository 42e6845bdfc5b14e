//! Models as the page of a person names them.

use crate::db::{Tx, sql};
use crate::scripts::slots::{is_trained, newest_checkpoint};
use crate::{Membership, StoreError, Tenant};
use yoto_proto::names::Collection;

/// All models of the tenant, oldest first, and whether the person is in each.
pub(crate) async fn with_person(
    tx: &mut Tx,
    tenant: &Tenant,
    subject_id: &str,
) -> Result<Vec<Membership>, StoreError> {
    let rows = sql(concat!(
        "SELECT m.id, m.display_name, s.slot, ",
        newest_checkpoint!(columns),
        " FROM models m LEFT JOIN slots s ON s.model = m.id AND s.subject = $2",
        newest_checkpoint!(join),
        "WHERE m.tenant = $1 ORDER BY m.ord"
    ))
    .bind(tenant.id())
    .bind(subject_id)
    .rows(tx, "listing the models of a person")
    .await?;
    let models = rows.iter().map(|row| {
        let slot = row.maybe_number("slot")?;
        Ok(Membership {
            model: Collection::Models.name(&row.text("id")?),
            display_name: row.text("display_name")?,
            trained: slot.map(|slot| is_trained(row, slot)).transpose()?,
        })
    });
    models.collect()
}
