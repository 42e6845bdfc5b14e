//! The object store, for everything too large for messages and the database. Coordinator and workers open
//! the same one.
//!
//! What is written gets a checksum, and what is read whole is compared with it. An object appears as a whole
//! or not at all, and once a write has returned it is on disk. A missing or altered object is an answer, not
//! a fault of the store: it is reported at once, also by a store that waits faults out.

mod error;
mod parts;
mod probe;
mod read;

pub use error::ObjectsError;
pub use parts::{Extent, Part, Piece};

use bytes::Bytes;
use object_store::local::LocalFileSystem;
use object_store::path::Path as Key;
use object_store::prefix::PrefixStore;
use object_store::{ObjectStore, ObjectStoreExt};
use std::future::Future;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use url::Url;
use yoto_proto::backoff::Backoff;
use yoto_proto::sha256_hex;
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
    attempts: u32,
}

impl Objects {
    /// Opens the store at `url`, e.g. `file:///var/lib/yoto/objects`, whose folder exists.
    ///
    /// # Errors
    /// When the scheme is not supported, or the folder is missing.
    pub fn open(url: &Url) -> Result<Self, ObjectsError> {
        let refused = |error: object_store::Error| ObjectsError::url(url, error);
        if url.scheme() == "file" {
            let folder = folder(url)?;
            let store = LocalFileSystem::new_with_prefix(folder).map_err(refused)?;
            return Ok(Self::over(Arc::new(store.with_fsync(true))));
        }
        let (store, prefix) = object_store::parse_url(url).map_err(refused)?;
        Ok(Self::over(Arc::new(PrefixStore::new(store, prefix))))
    }

    /// Uses a store that is open already.
    pub fn over(store: Arc<dyn ObjectStore>) -> Self {
        Self { store, attempts: 1 }
    }

    /// The same store, whose faults are waited out: each read and write is tried [`ATTEMPTS`] times. For
    /// jobs, which would each need the same loop; a coordinator answers its caller at once.
    #[must_use]
    pub fn patient(mut self) -> Self {
        self.attempts = ATTEMPTS;
        self
    }

    /// Writes a complete object, and gives it its checksum.
    ///
    /// # Errors
    /// When the key is malformed or the store fails.
    pub async fn put(&self, key: &str, bytes: Bytes) -> Result<ObjectRef, ObjectsError> {
        let path = parse(key)?;
        self.attempt("writing", key, || {
            self.store.put(&path, bytes.clone().into())
        })
        .await?;
        Ok(ObjectRef {
            key: key.into(),
            bytes: bytes.len() as u64,
            sha256: sha256_hex(&bytes),
        })
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
                Err(error @ object_store::Error::NotFound { .. }) => {
                    return Err(ObjectsError::of_store(action, key, error));
                }
                Err(error) if attempts == self.attempts => {
                    return Err(ObjectsError::of_store(action, key, error));
                }
                Err(error) => {
                    tracing::debug!(key, attempts, %error, "object store fault, trying again");
                    attempts += 1;
                    tokio::time::sleep(backoff.pause()).await;
                }
            }
        }
    }
}

/// The folder that a `file` URL names.
///
/// # Errors
/// When it names none.
pub fn folder(url: &Url) -> Result<PathBuf, ObjectsError> {
    let path = url.to_file_path();
    path.map_err(|()| ObjectsError::url(url, "names no folder of this machine"))
}

/// `url` as people may see it: without user, password and parameters, in which credentials may be.
pub fn shown(url: &Url) -> Url {
    let mut shown = url.clone();
    // Both fail for URLs that can't have a user at all.
    let _ = shown.set_username("");
    let _ = shown.set_password(None);
    shown.set_query(None);
    shown.set_fragment(None);
    shown
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
mod tests;
