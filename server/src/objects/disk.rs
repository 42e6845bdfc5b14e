//! The folder in which the objects are.

use super::room::Room;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use url::Url;
use yoto_objects::{Objects, ObjectsError};
use yoto_process::private;
use yoto_proto::keys;

/// The folder of a local object store, for operations that the object store's interface lacks.
#[derive(Debug, Clone)]
pub(crate) struct ObjectDisk {
    pub(super) root: PathBuf,
}

impl ObjectDisk {
    /// The folder at `url` (`file:///folder`), created if missing, with its store.
    ///
    /// # Errors
    /// When the URL names no folder, or the folder can't be used.
    pub(crate) fn open(url: &Url) -> Result<(Self, Objects), ObjectsError> {
        let disk = Self::create(yoto_objects::folder(url)?)?;
        Ok((disk, Objects::open(url)?))
    }

    /// The folder `root`, created if missing.
    ///
    /// # Errors
    /// When it can't be used.
    pub(crate) fn create(root: PathBuf) -> Result<Self, ObjectsError> {
        private::create_dir_all(&root).map_err(|error| failed("creating", &root, error))?;
        Ok(Self { root })
    }

    /// Free and total bytes; `None` if the system does not report them.
    pub(crate) fn room(&self) -> Option<Room> {
        Room::of(&self.root)
    }

    /// Makes `folder`, which other users of this machine can't look into, for objects of people. The store makes missing
    /// folders by the umask.
    ///
    /// # Errors
    /// When the disk fails.
    pub(crate) async fn make_private(&self, folder: &str) -> Result<(), ObjectsError> {
        let path = self.root.join(folder);
        let made = {
            let path = path.clone();
            tokio::task::spawn_blocking(move || private::create_dir_all(&path)).await
        };
        made.unwrap_or_else(|error| Err(io::Error::other(error)))
            .map_err(|error| failed("creating", &path, error))
    }

    /// Checks that the folder exists.
    ///
    /// # Errors
    /// When it does not, or can't be seen.
    pub(crate) async fn is_there(&self) -> Result<(), ObjectsError> {
        let seen = tokio::fs::metadata(&self.root).await;
        seen.map(drop)
            .map_err(|error| failed("looking for", &self.root, error))
    }

    /// Deletes `folder` with all its objects.
    ///
    /// # Errors
    /// When the disk fails; some objects may be gone then.
    pub(crate) async fn delete_folder(&self, folder: &str) -> Result<(), ObjectsError> {
        let path = self.root.join(folder);
        match tokio::fs::remove_dir_all(&path).await {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                return Err(failed("deleting", &path, error));
            }
            _ => self.remove_empty_parents(folder).await,
        }
        Ok(())
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

pub(crate) fn failed(action: &'static str, path: &Path, cause: io::Error) -> ObjectsError {
    ObjectsError::Disk {
        action,
        path: path.to_owned(),
        cause,
    }
}
