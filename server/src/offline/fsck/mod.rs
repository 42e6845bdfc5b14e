//! Whether the objects of a service are what its rows say.
//!
//! The check only reads, so a service may run meanwhile. The store is listed before the rows are read, and an object is written
//! before a row names it: what has no row then is an orphan, unless its lease or its upload may still commit it. An object that
//! is missing or damaged counts only if its row is still there after it was read, since a service may remove both.

mod orphans;
mod verify;

use crate::ServerError;
use crate::data_dir::{DATABASE_FILE, OBJECTS_FOLDER, folder_url};
use futures::TryStreamExt;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use thiserror::Error;
use url::Url;
use yoto_objects::{Environment, Listed, Objects, ObjectsError};
use yoto_process::clock::SystemClock;
use yoto_proto::keys;
use yoto_proto::v1::ObjectRef;
use yoto_store::{PostgresUrl, References, Store, binding};

/// Where a service has its state.
#[derive(Debug, Clone)]
pub struct Place {
    /// The data folder.
    pub data_dir: PathBuf,
    /// A database of PostgreSQL instead of the file in the data folder.
    pub database: Option<PostgresUrl>,
    /// Another object store than the folder in the data folder.
    pub objects: Option<Url>,
    /// Settings and credentials of a remote store.
    pub environment: Environment,
}

/// What was found.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Report {
    /// Number of objects that rows or manifests name.
    pub objects: u64,
    /// Their bytes.
    pub bytes: u64,
    /// Those that the store does not have.
    pub missing: Vec<ObjectFault>,
    /// Those with another length or checksum, and manifests that can't be read.
    pub damaged: Vec<ObjectFault>,
    /// Objects that nothing names and nobody can commit any more. The next collection notes most of them as garbage.
    pub orphans: Vec<Listed>,
}

impl Report {
    /// Whether every object that is named is there and has its bytes.
    pub fn is_sound(&self) -> bool {
        self.missing.is_empty() && self.damaged.is_empty()
    }
}

/// What is wrong with an object.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ObjectFault {
    /// Its key.
    pub key: String,
    /// The resource that names it, e.g. `jobs/{id}`.
    pub of: String,
    /// What is wrong, in words.
    pub what: String,
}

/// The reason why a service can't be checked.
#[derive(Debug, Error)]
pub enum FsckError {
    /// There is nothing to check.
    #[error("there is no service's database at {}", .0.display())]
    NoService(PathBuf),
    /// The database or the data folder can't be used.
    #[error(transparent)]
    Server(#[from] ServerError),
    /// The object store can't be read.
    #[error(transparent)]
    Objects(#[from] ObjectsError),
}

/// How far a check is.
#[derive(Debug, Clone, Copy, Default)]
pub struct Progress {
    /// Bytes that were read.
    pub bytes: u64,
    /// All bytes of the objects to read.
    pub of: u64,
}

/// Reads every object of the service at `place`, and tells `progress` how far it is.
///
/// # Errors
/// When the database or the object store can't be read. A faulty object is no error.
pub async fn fsck(place: &Place, progress: impl FnMut(Progress)) -> Result<Report, FsckError> {
    let store = open(place).await?;
    let report = check(place, &store, progress).await;
    store.close().await;
    report
}

async fn check(
    place: &Place,
    store: &Store,
    progress: impl FnMut(Progress),
) -> Result<Report, FsckError> {
    let url = match &place.objects {
        Some(url) => url.clone(),
        None => folder_url(&absolute(&place.data_dir.join(OBJECTS_FOLDER))?)?,
    };
    let objects = Objects::open_with(&url, &place.environment)?.patient();
    if let Some(id) = store.id_of_objects().await.map_err(ServerError::from)? {
        binding::belong(&objects, &url, &id)
            .await
            .map_err(ServerError::from)?;
    }
    let listed = list(&objects).await?;
    let references = read(store).await?;
    let mut found = verify::all(&objects, &references.objects, progress).await?;
    if !found.faults.is_empty() {
        let again = read(store).await?;
        let named: HashSet<&ObjectRef> = again.objects.iter().map(|it| &it.object).collect();
        found
            .faults
            .retain(|fault| named.contains(&fault.by.object));
    }
    let orphans = orphans::among(listed, &references, &found);
    let (missing, damaged): (Vec<_>, Vec<_>) =
        found.faults.into_iter().partition(|it| it.is_missing);
    let told = |faults: Vec<verify::Faulty<'_>>| faults.into_iter().map(|it| it.fault).collect();
    Ok(Report {
        objects: found.keys.len() as u64,
        bytes: found.bytes,
        missing: told(missing),
        damaged: told(damaged),
        orphans,
    })
}

async fn open(place: &Place) -> Result<Store, FsckError> {
    let clock = Arc::new(SystemClock);
    let opened = match &place.database {
        Some(url) => Store::inspect_postgres(url, clock).await,
        None => {
            let file = place.data_dir.join(DATABASE_FILE);
            if !file.is_file() {
                return Err(FsckError::NoService(file));
            }
            Store::inspect_sqlite(&file, clock).await
        }
    };
    Ok(opened.map_err(ServerError::from)?)
}

async fn read(store: &Store) -> Result<References, ServerError> {
    Ok(store.references_to_objects().await?)
}

/// All objects that a service can have written, but the one that names the store.
async fn list(objects: &Objects) -> Result<Vec<Listed>, ObjectsError> {
    let mut found = Vec::new();
    for (root, _) in keys::ROOTS {
        found.extend(objects.list(root).try_collect::<Vec<_>>().await?);
    }
    Ok(found)
}

fn absolute(path: &Path) -> Result<PathBuf, ServerError> {
    path.canonicalize().map_err(|cause| ServerError::DataDir {
        path: path.to_owned(),
        cause,
    })
}
