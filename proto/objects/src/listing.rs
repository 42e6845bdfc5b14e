//! Objects below a prefix: their list, in pages, and their removal, in bulk.

use super::{Objects, ObjectsError, parse};
use futures::stream::BoxStream;
use futures::{StreamExt, TryStreamExt, stream};
use object_store::path::Path as Key;

/// An object in a list.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Listed {
    /// Its key.
    pub key: String,
    /// Its size.
    pub bytes: u64,
}

impl Objects {
    /// The objects in `folder` and its subfolders, in no particular order.
    ///
    /// # Errors
    /// Of an item: when the store fails.
    pub fn list(&self, folder: &str) -> BoxStream<'static, Result<Listed, ObjectsError>> {
        let prefix = match parse(folder) {
            Ok(prefix) => prefix,
            Err(error) => return stream::once(async { Err(error) }).boxed(),
        };
        let failed = folder.to_owned();
        let listed = self.store.list(Some(&prefix));
        listed
            .map_ok(|it| Listed {
                key: it.location.to_string(),
                bytes: it.size,
            })
            .map_err(move |cause| ObjectsError::of_store("listing", &failed, cause))
            .boxed()
    }

    /// Deletes the object `key`. What is gone already is not an error.
    ///
    /// # Errors
    /// When the store fails.
    pub async fn delete(&self, key: &str) -> Result<(), ObjectsError> {
        let path = parse(key)?;
        self.delete_all(key, stream::once(async { Ok(path) }).boxed())
            .await
    }

    /// Deletes all objects in `folder` and its subfolders. What is gone already is not an error.
    ///
    /// # Errors
    /// When the store fails; some objects may be gone then.
    pub async fn delete_folder(&self, folder: &str) -> Result<(), ObjectsError> {
        let found = self.store.list(Some(&parse(folder)?));
        self.delete_all(folder, found.map_ok(|it| it.location).boxed())
            .await
    }

    async fn delete_all(
        &self,
        shown: &str,
        found: BoxStream<'static, object_store::Result<Key>>,
    ) -> Result<(), ObjectsError> {
        let mut deleted = self.store.delete_stream(found);
        while let Some(deleted) = deleted.next().await {
            match deleted.map_err(|cause| ObjectsError::of_store("deleting", shown, cause)) {
                Ok(_) | Err(ObjectsError::Missing { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}
