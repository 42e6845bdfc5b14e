//! The store in which the objects of this database are.

use crate::StoreError;
use crate::db::{Tx, sql};

/// The id of the database's object store, if it has one yet.
pub(crate) async fn id(tx: &mut Tx) -> Result<Option<String>, StoreError> {
    let row = sql("SELECT id FROM object_store").row(tx, "looking for the object store");
    row.await?.map(|row| row.text("id")).transpose()
}

/// Notes the id of the database's object store, which has none yet.
pub(crate) async fn note(tx: &mut Tx, id: &str) -> Result<(), StoreError> {
    sql("INSERT INTO object_store (one, id) VALUES (1, $1)")
        .bind(id)
        .execute(tx, "noting the object store")
        .await?;
    Ok(())
}
