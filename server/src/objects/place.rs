//! Where the objects are: a folder of this machine, or a remote store. Both list and delete whole folders, and tell how
//! much room is left.

use super::disk::ObjectDisk;
use super::folders::Folder;
use super::room::Room;
use crate::config::ServerConfig;
use futures::TryStreamExt;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use url::Url;
use yoto_objects::{Objects, ObjectsError, Rights};
use yoto_proto::keys;

/// Folder of the data folder with the files of open uploads, if the store is remote: an object can't grow there.
const OPEN_UPLOADS: &str = "open-uploads";
/// No collection has counted the store's bytes yet.
const UNKNOWN: u64 = u64::MAX;

/// The place of the objects.
#[derive(Debug)]
pub struct Place {
    /// Their folder; for a remote store, the folder of open uploads.
    disk: ObjectDisk,
    remote: Option<Objects>,
    /// Bytes that the store may have.
    limit: Option<u64>,
    /// Bytes that it had at the last collection.
    used: AtomicU64,
}

impl Place {
    /// Opens the store at `url`, and tries everything that the service does if it is remote. Open uploads are in
    /// `data_dir` then.
    ///
    /// # Errors
    /// When the store can't be used, with what to do about it.
    pub async fn open(
        url: &Url,
        data_dir: &Path,
        config: &ServerConfig,
    ) -> Result<(Self, Objects), ObjectsError> {
        let (disk, objects) = match url.scheme() {
            "file" => ObjectDisk::open(url)?,
            _ => {
                let objects = Objects::open_with(url, &config.environment)?;
                objects.check(Rights::All).await?;
                (ObjectDisk::create(data_dir.join(OPEN_UPLOADS))?, objects)
            }
        };
        let place = Self {
            disk,
            remote: objects.is_remote().then(|| objects.clone()),
            limit: config.storage.limit_bytes,
            used: AtomicU64::new(UNKNOWN),
        };
        Ok((place, objects))
    }

    /// The folder in which files of uploads grow.
    pub fn uploads(&self) -> &ObjectDisk {
        &self.disk
    }

    /// Copies a complete file of an upload to a remote store, unless an earlier call has done it. In a folder, it is there
    /// already.
    ///
    /// # Errors
    /// When the file can't be read, or the store fails.
    pub async fn publish(&self, key: &str, bytes: u64) -> Result<(), ObjectsError> {
        match &self.remote {
            Some(objects) => objects.put_file(key, &self.disk.path(key), bytes).await,
            None => Ok(()),
        }
    }

    /// Removes the files of a finished upload of which a remote store has copies. Those that stay are removed with the
    /// upload.
    pub async fn forget_upload(&self, id: &str) {
        if self.remote.is_none() {
            return;
        }
        if let Err(error) = self.disk.delete_folder(&keys::upload_folder(id)).await {
            tracing::warn!(
                upload = id,
                error = error.with_causes(),
                "files of a finished upload stay on the disk"
            );
        }
    }

    /// All folders that are kept or deleted as a whole. Counts the bytes of the store for [`Self::room`].
    ///
    /// # Errors
    /// When a store fails.
    pub async fn folders(&self) -> Result<Vec<Folder>, ObjectsError> {
        let on_disk = self.disk.folders().await?;
        let found = match &self.remote {
            Some(objects) => merged(on_disk, remote_folders(objects).await?),
            None => on_disk,
        };
        let bytes = found.iter().map(|it| it.bytes).sum();
        self.used.store(bytes, Ordering::Relaxed);
        Ok(found)
    }

    /// Deletes `folder` with all its objects.
    ///
    /// # Errors
    /// When a store fails; some objects may be gone then.
    pub async fn delete_folder(&self, folder: &str) -> Result<(), ObjectsError> {
        if let Some(objects) = &self.remote {
            objects.delete_folder(folder).await?;
        }
        self.disk.delete_folder(folder).await
    }

    /// Free and total bytes: what the limit leaves as of the last collection, and what the disk has if the store is a
    /// folder of it. `None` if neither is known.
    pub fn room(&self) -> Option<Room> {
        let disk = match self.remote {
            Some(_) => None,
            None => self.disk.room(),
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
    for (root, depth) in keys::ROOTS {
        let mut listed = objects.list(root);
        while let Some(object) = listed.try_next().await? {
            let Some(key) = folder_of(&object.key, *depth) else {
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

/// The folder that is `depth` levels below the first one of `key`; `None` for an object that is not in one.
fn folder_of(key: &str, depth: usize) -> Option<&str> {
    let (end, _) = key.match_indices('/').nth(depth)?;
    Some(&key[..end])
}

/// The folders of both places, each once.
fn merged(one: Vec<Folder>, other: Vec<Folder>) -> Vec<Folder> {
    let mut all: BTreeMap<String, Folder> = BTreeMap::new();
    for folder in one.into_iter().chain(other) {
        all.entry(folder.key.clone())
            .and_modify(|it| {
                it.files += folder.files;
                it.bytes += folder.bytes;
            })
            .or_insert(folder);
    }
    all.into_values().collect()
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
        let twice = merged(on_disk.clone(), remote);
        assert_eq!((twice.len(), twice[0].bytes), (3, 2 * on_disk[0].bytes));
    }

    #[tokio::test]
    async fn the_limit_counts_what_the_last_collection_found() {
        let dir = tempfile::tempdir().expect("a folder");
        let url = Url::from_directory_path(dir.path()).expect("a URL");
        let mut config = ServerConfig::new(dir.path());
        config.storage.limit_bytes = Some(10);
        let (place, objects) = Place::open(&url, dir.path(), &config).await.expect("opens");
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
