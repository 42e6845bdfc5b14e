//! Where the objects are: a folder of this machine, or a remote store. Both list and delete whole folders, and tell how
//! much room is left.

use super::disk::ObjectDisk;
use super::folders::Folder;
use super::room::Room;
use crate::config::ServerConfig;
use futures::TryStreamExt;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use url::Url;
use yoto_objects::{Objects, ObjectsError, Rights};
use yoto_proto::keys;

/// No collection has counted the store's bytes yet.
const UNKNOWN: u64 = u64::MAX;

/// The place of the objects.
#[derive(Debug)]
pub(crate) struct ObjectsPlace {
    store: Backing,
    /// Bytes that the store may have.
    limit: Option<u64>,
    /// Bytes that it had at the last collection.
    used: AtomicU64,
}

#[derive(Debug)]
enum Backing {
    Folder(ObjectDisk),
    Remote(Objects),
}

impl ObjectsPlace {
    /// Opens the store at `url`, and tries everything that the service does if it is remote.
    ///
    /// # Errors
    /// When the store can't be used, with what to do about it.
    pub(crate) async fn open(
        url: &Url,
        config: &ServerConfig,
    ) -> Result<(Self, Objects), ObjectsError> {
        let (store, objects) = match url.scheme() {
            "file" => {
                let (disk, objects) = ObjectDisk::open(url)?;
                (Backing::Folder(disk), objects)
            }
            _ => {
                let objects = Objects::open_with(url, &config.environment)?;
                objects.check(Rights::All).await?;
                (Backing::Remote(objects.clone()), objects)
            }
        };
        let place = Self {
            store,
            limit: config.storage.limit_bytes,
            used: AtomicU64::new(UNKNOWN),
        };
        Ok((place, objects))
    }

    /// Checks that the folder exists, if it is one.
    ///
    /// # Errors
    /// When it does not, or can't be seen.
    pub(crate) async fn is_there(&self) -> Result<(), ObjectsError> {
        match &self.store {
            Backing::Folder(disk) => disk.is_there().await,
            Backing::Remote(_) => Ok(()),
        }
    }

    /// Keeps other users of this machine out of `folder`, which gets objects of people. A remote store has rights of its own.
    ///
    /// # Errors
    /// When the disk fails.
    pub(crate) async fn make_private(&self, folder: &str) -> Result<(), ObjectsError> {
        match &self.store {
            Backing::Folder(disk) => disk.make_private(folder).await,
            Backing::Remote(_) => Ok(()),
        }
    }

    /// All folders that are kept or deleted as a whole. Counts the bytes of the store for [`Self::room`].
    ///
    /// # Errors
    /// When the store fails.
    pub(crate) async fn folders(&self) -> Result<Vec<Folder>, ObjectsError> {
        let found = match &self.store {
            Backing::Folder(disk) => disk.folders().await?,
            Backing::Remote(objects) => remote_folders(objects).await?,
        };
        let bytes = found.iter().map(|it| it.bytes).sum();
        self.used.store(bytes, Ordering::Relaxed);
        Ok(found)
    }

    /// Deletes `folder` with all its objects.
    ///
    /// # Errors
    /// When the store fails; some objects may be gone then.
    pub(crate) async fn delete_folder(&self, folder: &str) -> Result<(), ObjectsError> {
        match &self.store {
            Backing::Folder(disk) => disk.delete_folder(folder).await,
            Backing::Remote(objects) => objects.delete_folder(folder).await,
        }
    }

    /// Free and total bytes: what the limit leaves as of the last collection, and what the disk has if the store is a
    /// folder of it. `None` if neither is known.
    pub(crate) fn room(&self) -> Option<Room> {
        let disk = match &self.store {
            Backing::Folder(disk) => disk.room(),
            Backing::Remote(_) => None,
        };
        let used = self.used.load(Ordering::Relaxed);
        let limited = self.limit.filter(|_| used != UNKNOWN).map(|total| Room {
            free: total.saturating_sub(used),
            total,
        });
        match (disk, limited) {
            (Some(disk), Some(limited)) if limited.free < disk.free => Some(limited),
            (Some(disk), _) => Some(disk),
            (None, limited) => limited,
        }
    }
}

/// The folders of a remote store, by its objects.
async fn remote_folders(objects: &Objects) -> Result<Vec<Folder>, ObjectsError> {
    let mut found: BTreeMap<String, Folder> = BTreeMap::new();
    for (root, _) in keys::ROOTS {
        let mut listed = objects.list(root);
        while let Some(object) = listed.try_next().await? {
            let Some(key) = keys::collected_folder(&object.key) else {
                continue;
            };
            let folder = found.entry(key.to_owned()).or_insert_with(|| Folder {
                key: key.to_owned(),
                files: 0,
                bytes: 0,
            });
            folder.files += 1;
            folder.bytes += object.bytes;
        }
    }
    Ok(found.into_values().collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytes::Bytes;

    #[tokio::test]
    async fn folders_of_a_remote_store_are_those_of_a_disk() {
        let dir = tempfile::tempdir().expect("a folder");
        let url = Url::from_directory_path(dir.path()).expect("a URL");
        let (disk, objects) = ObjectDisk::open(&url).expect("opens");
        for key in [
            "models/m/j-1/000000005/manifest.json",
            "models/m/j-1/000000005/a",
            "renders/j/1/0.png",
            "uploads/c/a/b",
            "other/x",
        ] {
            objects
                .put(key, Bytes::from_static(b"abc"))
                .await
                .expect("put");
        }
        let mut on_disk = disk.folders().await.expect("lists");
        on_disk.sort_by(|a, b| a.key.cmp(&b.key));
        let remote = remote_folders(&objects).await.expect("lists");
        assert_eq!(remote, on_disk);
        assert_eq!(remote.len(), 3);
    }

    #[tokio::test]
    async fn the_limit_counts_what_the_last_collection_found() {
        let dir = tempfile::tempdir().expect("a folder");
        let url = Url::from_directory_path(dir.path()).expect("a URL");
        let mut config = ServerConfig::new(dir.path());
        config.storage.limit_bytes = Some(10);
        let (place, objects) = ObjectsPlace::open(&url, &config).await.expect("opens");
        let on_disk = place.room().expect("has a disk").total;
        assert!(on_disk > 10, "nothing is counted yet");
        objects
            .put("uploads/c/a", Bytes::from_static(b"abcd"))
            .await
            .expect("put");
        place.folders().await.expect("lists");
        let room = place.room().expect("is limited");
        assert_eq!((room.free, room.total), (6, 10));
    }
}
