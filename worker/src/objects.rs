//! The object store: writes with a checksum, reads verified by the checksum.
//!
//! A fault of the store is retried here, because every job would otherwise need the same
//! loop; a missing or altered object is an answer, not a fault, and is reported at once.

use crate::retry::Backoff;
use bytes::Bytes;
use futures::StreamExt;
use object_store::{
    ObjectStore, ObjectStoreExt, local::LocalFileSystem, path::Path, prefix::PrefixStore,
};
use sha2::{Digest, Sha256};
use std::{future::Future, sync::Arc, time::Duration};
use thiserror::Error;
use tokio::io::AsyncWriteExt;
use url::Url;
use yoto_proto::{sha256_hex, v1::ObjectRef};

/// Attempts per read or write before its fault is reported.
const ATTEMPTS: u32 = 8;
/// Pause after the first fault; it doubles up to [`LONGEST_PAUSE`].
const FIRST_PAUSE: Duration = Duration::from_millis(100);
const LONGEST_PAUSE: Duration = Duration::from_secs(10);

/// A handle on the object store; clones share it.
#[derive(Debug, Clone)]
pub struct Objects {
    store: Arc<dyn ObjectStore>,
}

/// The reason why an object could not be read or written.
#[derive(Debug, Error)]
pub enum ObjectsError {
    /// The store's URL is not usable.
    #[error("the object store {url} can't be opened: {reason}")]
    Url {
        /// As configured.
        url: String,
        /// The fault.
        reason: String,
    },
    /// The store kept failing.
    #[error("the object store failed at {key}, {ATTEMPTS} times in a row")]
    Store {
        /// The object.
        key: String,
        /// The last fault.
        source: object_store::Error,
    },
    /// No object has this key.
    #[error("object {key} is missing")]
    Missing {
        /// The object.
        key: String,
    },
    /// The object differs from what was written.
    #[error(
        "object {key} is torn or altered: {found_bytes} bytes with SHA-256 {found}, but {expected_bytes} bytes with {expected} were written"
    )]
    Altered {
        /// The object.
        key: String,
        /// Size it must have.
        expected_bytes: u64,
        /// Checksum it must have.
        expected: String,
        /// Size it has.
        found_bytes: u64,
        /// Checksum it has.
        found: String,
    },
    /// This machine's disk failed.
    #[error("{}", path.display())]
    Disk {
        /// What was written.
        path: std::path::PathBuf,
        /// Why it could not be.
        source: std::io::Error,
    },
    /// The key is invalid.
    #[error("'{key}' is not an object key")]
    Key {
        /// As given.
        key: String,
        /// The fault.
        source: object_store::path::Error,
    },
}

impl ObjectsError {
    /// Whether the object is missing or damaged, so that a retry is useless and an older one is
    /// needed.
    pub fn is_torn(&self) -> bool {
        matches!(
            self,
            Self::Missing { .. } | Self::Altered { .. } | Self::Key { .. }
        )
    }
}

impl Objects {
    /// Opens the store at `url`, e.g. `file:///var/lib/yoto/objects`.
    ///
    /// # Errors
    /// When the URL can't be read, its scheme is not supported, or its folder is missing.
    pub fn from_url(url: &str) -> Result<Self, ObjectsError> {
        let error = |reason: String| ObjectsError::Url {
            url: url.into(),
            reason,
        };
        let parsed = Url::parse(url).map_err(|e| error(e.to_string()))?;
        if parsed.scheme() == "file" {
            let folder = parsed
                .to_file_path()
                .map_err(|()| error("it names no local folder".into()))?;
            let store =
                LocalFileSystem::new_with_prefix(folder).map_err(|e| error(e.to_string()))?;
            return Ok(Self::from_store(Arc::new(store.with_fsync(true))));
        }
        let (store, prefix) = object_store::parse_url(&parsed).map_err(|e| error(e.to_string()))?;
        Ok(Self::from_store(Arc::new(PrefixStore::new(store, prefix))))
    }

    /// Uses a store that is already open.
    pub fn from_store(store: Arc<dyn ObjectStore>) -> Self {
        Self { store }
    }

    /// The bytes of `object`, after a check of their size and SHA-256.
    ///
    /// # Errors
    /// [`ObjectsError::Missing`], [`ObjectsError::Altered`], or the store's fault.
    pub async fn get(&self, object: &ObjectRef) -> Result<Bytes, ObjectsError> {
        let key = &object.key;
        let path = path(key)?;
        let bytes = self
            .attempt(key, || async { self.store.get(&path).await?.bytes().await })
            .await?;
        let found = sha256_hex(&bytes);
        if found != object.sha256 || bytes.len() as u64 != object.bytes {
            return Err(ObjectsError::Altered {
                key: key.clone(),
                expected_bytes: object.bytes,
                expected: object.sha256.clone(),
                found_bytes: bytes.len() as u64,
                found,
            });
        }
        Ok(bytes)
    }

    /// Copies `object` into the file at `to`, and checks its size and SHA-256 on the way, so
    /// that an object larger than memory can be read.
    ///
    /// # Errors
    /// As [`Objects::get`]; [`ObjectsError::Disk`] when the file can't be written.
    pub async fn get_to_file(
        &self,
        object: &ObjectRef,
        to: &std::path::Path,
    ) -> Result<(), ObjectsError> {
        let key = &object.key;
        let from = path(key)?;
        let copied = self.attempt(key, || self.copy(&from, to)).await?;
        let (found_bytes, found) = copied.map_err(|source| ObjectsError::Disk {
            path: to.to_owned(),
            source,
        })?;
        if found != object.sha256 || found_bytes != object.bytes {
            return Err(ObjectsError::Altered {
                key: key.clone(),
                expected_bytes: object.bytes,
                expected: object.sha256.clone(),
                found_bytes,
                found,
            });
        }
        Ok(())
    }

    /// One attempt: bytes and SHA-256 of the copy; the inner error is the disk's.
    async fn copy(
        &self,
        from: &Path,
        to: &std::path::Path,
    ) -> object_store::Result<std::io::Result<(u64, String)>> {
        let mut stream = self.store.get(from).await?.into_stream();
        let mut file = match tokio::fs::File::create(to).await {
            Ok(file) => file,
            Err(error) => return Ok(Err(error)),
        };
        let (mut bytes, mut hash) = (0, Sha256::new());
        while let Some(chunk) = stream.next().await {
            let chunk = chunk?;
            bytes += chunk.len() as u64;
            hash.update(&chunk);
            if let Err(error) = file.write_all(&chunk).await {
                return Ok(Err(error));
            }
        }
        Ok(file
            .flush()
            .await
            .map(|()| (bytes, yoto_proto::hex(&hash.finalize()))))
    }

    /// Writes `bytes` at `key`, completely or not at all.
    ///
    /// # Errors
    /// The store's fault.
    pub async fn put(&self, key: &str, bytes: Bytes) -> Result<ObjectRef, ObjectsError> {
        let path = path(key)?;
        self.attempt(key, || self.store.put(&path, bytes.clone().into()))
            .await?;
        Ok(ObjectRef {
            key: key.into(),
            bytes: bytes.len() as u64,
            sha256: sha256_hex(&bytes),
        })
    }

    async fn attempt<T, F>(&self, key: &str, mut call: impl FnMut() -> F) -> Result<T, ObjectsError>
    where
        F: Future<Output = object_store::Result<T>>,
    {
        let mut backoff = Backoff::new(FIRST_PAUSE, LONGEST_PAUSE);
        let mut attempt = 1;
        loop {
            match call().await {
                Ok(value) => return Ok(value),
                Err(object_store::Error::NotFound { .. }) => {
                    return Err(ObjectsError::Missing { key: key.into() });
                }
                Err(source) if attempt == ATTEMPTS => {
                    return Err(ObjectsError::Store {
                        key: key.into(),
                        source,
                    });
                }
                Err(error) => {
                    tracing::debug!(key, attempt, %error, "object store fault, trying again");
                    attempt += 1;
                    tokio::time::sleep(backoff.pause()).await;
                }
            }
        }
    }
}

fn path(key: &str) -> Result<Path, ObjectsError> {
    Path::parse(key).map_err(|source| ObjectsError::Key {
        key: key.into(),
        source,
    })
}

#[cfg(test)]
mod tests;
