//! What a check of the whole service reads.

use crate::scripts::{named, object_store};
use crate::{References, Store, StoreError};

impl Store {
    /// All references to objects, as of one moment.
    pub async fn references_to_objects(&self) -> Result<References, StoreError> {
        named::all(&mut self.db.snapshot().await?).await
    }

    /// The id of the object store of this database, if a coordinator has run on it.
    pub async fn id_of_objects(&self) -> Result<Option<String>, StoreError> {
        object_store::id(&mut self.db.snapshot().await?).await
    }
}
