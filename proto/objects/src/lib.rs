//! The object store, for everything too large for messages and the database. Coordinator and workers open
//! the same one.
//!
//! What is written gets a checksum, and what is read whole is compared with it. An object appears as a whole
//! or not at all, and once a write has returned it is on disk. A missing or altered object is an answer, not
//! a fault of the store: it is reported at once, also by a store that waits faults out.

mod check;
mod class;
mod environment;
mod error;
mod listing;
mod open;
mod parts;
mod probe;
mod read;
mod s3;
mod sign;
mod write;

pub use check::Rights;
pub use environment::Environment;
pub use error::ObjectsError;
pub use listing::Listed;
pub use open::{folder, shown};
pub use parts::{Extent, Part, Piece};
pub use sign::SignedPut;

use object_store::path::Path as Key;
use object_store::{ObjectStore, ObjectStoreExt};
use sign::Signing;
use std::future::Future;
use std::sync::Arc;
use std::time::Duration;
use url::Url;
use yoto_proto::backoff::Backoff;
use yoto_proto::v1::ObjectRef;

/// Attempts of a patient store.
const ATTEMPTS: u32 = 8;
/// Pause after the first fault; it doubles up to [`LONGEST_PAUSE`].
const FIRST_PAUSE: Duration = Duration::from_millis(100);
const LONGEST_PAUSE: Duration = Duration::from_secs(10);

/// An open object store; clones share it.
#[derive(Debug, Clone)]
pub struct Objects {
    store: Arc<dyn ObjectStore>,
    /// The URL of a store that is not a folder of this machine.
    remote: Option<Arc<Url>>,
    /// Of a store that signs URLs.
    signing: Option<Signing>,
    attempts: u32,
}

impl Objects {
    /// Uses a store that is open already.
    pub fn over(store: Arc<dyn ObjectStore>) -> Self {
        Self {
            store,
            remote: None,
            signing: None,
            attempts: 1,
        }
    }

    /// The same store inside another one, such as a test's that fails.
    #[must_use]
    pub fn inside(
        mut self,
        wrap: impl FnOnce(Arc<dyn ObjectStore>) -> Arc<dyn ObjectStore>,
    ) -> Self {
        self.store = wrap(self.store);
        self
    }

    /// The same store, whose faults are waited out: each read and write is tried [`ATTEMPTS`] times. For
    /// jobs, which would each need the same loop; a coordinator answers its caller at once.
    #[must_use]
    pub fn patient(mut self) -> Self {
        self.attempts = ATTEMPTS;
        self
    }

    /// Checks that the object exists and has the size in `object`.
    ///
    /// # Errors
    /// When it does not, or the store fails.
    pub async fn require(&self, object: &ObjectRef) -> Result<(), ObjectsError> {
        let path = parse(&object.key)?;
        let found = self.attempt("looking for", &object.key, || self.store.head(&path));
        same_size(object, found.await?.size)
    }

    /// Calls the store until it answers, as often as this store is patient.
    async fn attempt<T, F>(
        &self,
        action: &'static str,
        key: &str,
        mut call: impl FnMut() -> F,
    ) -> Result<T, ObjectsError>
    where
        F: Future<Output = object_store::Result<T>>,
    {
        let mut backoff = Backoff::new(FIRST_PAUSE, LONGEST_PAUSE);
        let mut attempts = 1;
        loop {
            match call().await {
                Ok(value) => return Ok(value),
                Err(error) => {
                    let error = ObjectsError::of_store(action, key, error);
                    if attempts == self.attempts || error.is_torn() || error.is_refused() {
                        return Err(error);
                    }
                    tracing::debug!(
                        key,
                        attempts,
                        error = error.with_causes(),
                        "object store fault, trying again"
                    );
                    attempts += 1;
                    tokio::time::sleep(backoff.pause()).await;
                }
            }
        }
    }
}

fn parse(key: &str) -> Result<Key, ObjectsError> {
    Key::parse(key).map_err(|cause| ObjectsError::Key {
        key: key.to_owned(),
        cause,
    })
}

fn same_size(object: &ObjectRef, found: u64) -> Result<(), ObjectsError> {
    if object.bytes == found {
        return Ok(());
    }
    Err(ObjectsError::Size {
        key: object.key.clone(),
        expected: object.bytes,
        found,
    })
}

#[cfg(test)]
mod remote_tests;
#[cfg(test)]
mod store_tests;
#[cfg(test)]
mod tests;
