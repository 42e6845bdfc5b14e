//! The object store, for everything too large for the database.

mod checked;
pub mod collect;
mod folders;
pub mod parts;
pub mod room;
pub mod upload;

use bytes::Bytes;
use futures::{StreamExt, TryStreamExt, stream::BoxStream};
use object_store::{
    GetOptions, GetRange, ObjectStore, ObjectStoreExt, local::LocalFileSystem, path::Path as Key,
};
use std::{ops::Range, path::PathBuf, sync::Arc};
use thiserror::Error;
use url::Url;
use yoto_proto::{keys, v1::ObjectRef};

/// A failure of the object store.
#[derive(Debug, Error)]
pub enum ObjectsError {
    /// The URL names no supported store.
    #[error("object store {url}: {reason}")]
    Url {
        /// The URL.
        url: Url,
        /// The fault.
        reason: String,
    },
    /// The key is invalid.
    #[error("object key '{key}': {cause}")]
    Key {
        /// The key.
        key: String,
        /// Why.
        cause: object_store::path::Error,
    },
    /// The store failed.
    #[error("{action} object '{key}': {cause}")]
    Store {
        /// E.g. "writing".
        action: &'static str,
        /// The key.
        key: String,
        /// The store's error.
        cause: object_store::Error,
    },
    /// The object has another size than in the catalogue.
    #[error("object '{key}' has {found} bytes, not {expected}")]
    Size {
        /// The key.
        key: String,
        /// Size in the catalogue or the request.
        expected: u64,
        /// Size in the store.
        found: u64,
    },
    /// The object has the right size and other bytes than were written.
    #[error("object '{key}' is altered: its SHA-256 is {found}, not {expected}")]
    Altered {
        /// The key.
        key: String,
        /// Checksum in the catalogue.
        expected: String,
        /// Checksum of what was read.
        found: String,
    },
}

impl ObjectsError {
    /// Whether the object is missing or differs, as opposed to a broken store.
    pub fn is_mismatch(&self) -> bool {
        match self {
            Self::Size { .. } | Self::Altered { .. } | Self::Key { .. } => true,
            Self::Store { cause, .. } => matches!(cause, object_store::Error::NotFound { .. }),
            Self::Url { .. } => false,
        }
    }
}

/// Room on the disk of an object store, bytes.
#[derive(Debug, Clone, Copy)]
pub struct Disk {
    /// Bytes that are free for this process.
    pub free: u64,
    /// All bytes.
    pub total: u64,
}

/// An open object store.
#[derive(Debug, Clone)]
pub struct Objects {
    store: Arc<dyn ObjectStore>,
    root: PathBuf,
    url: Url,
}

impl Objects {
    /// Opens the store at `url`: `file:///folder`, created if missing. A write
    /// returns when the object is on disk.
    ///
    /// # Errors
    /// When the scheme is not `file`, or the folder can't be used.
    pub fn open(url: &Url) -> Result<Self, ObjectsError> {
        let refuse = |reason: String| ObjectsError::Url {
            url: url.clone(),
            reason,
        };
        if url.scheme() != "file" {
            return Err(refuse("only file:/// is supported".into()));
        }
        let root = url
            .to_file_path()
            .map_err(|()| refuse("names no folder".into()))?;
        std::fs::create_dir_all(&root).map_err(|error| refuse(error.to_string()))?;
        let store = LocalFileSystem::new_with_prefix(&root)
            .map_err(|error| refuse(error.to_string()))?
            .with_fsync(true);
        Ok(Self {
            store: Arc::new(store),
            root,
            url: url.clone(),
        })
    }

    /// URL of the store, for processes that open it directly.
    pub fn url(&self) -> &Url {
        &self.url
    }

    /// Free and total bytes of the disk; `None` if they can't be told.
    pub fn disk(&self) -> Option<Disk> {
        Some(Disk {
            free: fs4::available_space(&self.root).ok()?,
            total: fs4::total_space(&self.root).ok()?,
        })
    }

    /// Writes a complete object.
    ///
    /// # Errors
    /// When the key is malformed or the store fails.
    pub async fn put(&self, key: &str, bytes: Bytes) -> Result<(), ObjectsError> {
        let put = self.store.put(&parse(key)?, bytes.into()).await;
        put.map(drop).map_err(|cause| failed("writing", key, cause))
    }

    /// Streams an object; the last item is an error if its bytes are not those of `object`.
    ///
    /// # Errors
    /// When it is missing or its size differs from `object`, or the store fails.
    pub async fn get(
        &self,
        object: &ObjectRef,
    ) -> Result<BoxStream<'static, Result<Bytes, ObjectsError>>, ObjectsError> {
        self.get_range(object, None).await
    }

    /// Streams the bytes of an object in `range`, which is not empty; all of them without one.
    ///
    /// # Errors
    /// As [`Self::get`]; when the object has no such bytes.
    pub async fn get_range(
        &self,
        object: &ObjectRef,
        range: Option<Range<u64>>,
    ) -> Result<BoxStream<'static, Result<Bytes, ObjectsError>>, ObjectsError> {
        let key = object.key.clone();
        let is_whole = range.as_ref().is_none_or(|it| *it == (0..object.bytes));
        let options = GetOptions {
            range: range.map(GetRange::Bounded),
            ..GetOptions::default()
        };
        let found = self.store.get_opts(&parse(&key)?, options).await;
        let found = found.map_err(|cause| failed("reading", &key, cause))?;
        same_size(object, found.meta.size)?;
        let chunks = found
            .into_stream()
            .map_err(move |cause| failed("reading", &key, cause))
            .boxed();
        Ok(match is_whole {
            true => checked::checked(object, chunks).boxed(),
            false => chunks,
        })
    }

    /// Checks that the object exists and has the size in `object`.
    ///
    /// # Errors
    /// When it does not, or the store fails.
    pub async fn require(&self, object: &ObjectRef) -> Result<(), ObjectsError> {
        let found = self.store.head(&parse(&object.key)?).await;
        let found = found.map_err(|cause| failed("looking for", &object.key, cause))?;
        same_size(object, found.size)
    }

    /// Deletes every object in `folder`, and the folder.
    ///
    /// # Errors
    /// When the store fails; some objects may be gone then.
    pub async fn delete_folder(&self, folder: &str) -> Result<(), ObjectsError> {
        let prefix = parse(folder)?;
        let found = self
            .store
            .list(Some(&prefix))
            .map_ok(|meta| meta.location)
            .boxed();
        self.store
            .delete_stream(found)
            .try_for_each(|_| std::future::ready(Ok(())))
            .await
            .map_err(|cause| failed("deleting", folder, cause))?;
        // A local store keeps empty folders, which would accumulate.
        match tokio::fs::remove_dir_all(self.root.join(folder)).await {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(local("deleting", folder, error))
            }
            _ => {
                self.remove_empty_parents(folder).await;
                Ok(())
            }
        }
    }

    /// Removes the folders above `folder` that are empty now. A writer makes them again.
    async fn remove_empty_parents(&self, folder: &str) {
        let mut parent = keys::folder(folder);
        while !parent.is_empty() {
            if tokio::fs::remove_dir(self.root.join(parent)).await.is_err() {
                return;
            }
            parent = keys::folder(parent);
        }
    }
}

fn parse(key: &str) -> Result<Key, ObjectsError> {
    Key::parse(key).map_err(|cause| ObjectsError::Key {
        key: key.to_owned(),
        cause,
    })
}

fn failed(action: &'static str, key: &str, cause: object_store::Error) -> ObjectsError {
    ObjectsError::Store {
        action,
        key: key.to_owned(),
        cause,
    }
}

pub(crate) fn local(action: &'static str, key: &str, error: std::io::Error) -> ObjectsError {
    let cause = object_store::Error::Generic {
        store: "local folder",
        source: Box::new(error),
    };
    failed(action, key, cause)
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
