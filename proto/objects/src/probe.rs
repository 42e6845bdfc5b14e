//! Whether the store answers.

use super::{Objects, ObjectsError, parse};
use object_store::ObjectStoreExt;

/// A key that no object has.
const NOTHING: &str = "health/nothing";

impl Objects {
    /// Asks for an object that does not exist.
    ///
    /// # Errors
    /// When the store fails.
    pub async fn answers(&self) -> Result<(), ObjectsError> {
        let path = parse(NOTHING)?;
        match self.store.head(&path).await {
            Ok(_) | Err(object_store::Error::NotFound { .. }) => Ok(()),
            Err(error) => Err(ObjectsError::of_store("looking for", NOTHING, error)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use object_store::memory::InMemory;
    use std::sync::Arc;

    #[tokio::test]
    async fn an_empty_store_answers() {
        let objects = Objects::over(Arc::new(InMemory::new()));
        objects.answers().await.expect("answers");
    }
}
