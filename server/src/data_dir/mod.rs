//! The data folder: what is in it, whose it is, and the database and object store that it names.

mod instance;
mod lock;

pub(crate) use instance::of as instance;
pub(crate) use lock::DataDirLock;

use crate::config::ServerConfig;
use crate::error::ServerError;
use std::path::{Path, PathBuf};
use url::Url;
use yoto_process::private;
use yoto_store::{Store, StoreError};

/// The database's file in the data folder, unless the configuration names a database of PostgreSQL.
pub(crate) const DATABASE_FILE: &str = "yoto.db";
/// The objects' folder in the data folder.
pub(crate) const OBJECTS_FOLDER: &str = "objects";

/// Where the objects are.
pub(crate) fn objects_url(config: &ServerConfig, data_dir: &Path) -> Result<Url, ServerError> {
    match &config.objects {
        Some(url) => Ok(url.clone()),
        None => folder_url(&data_dir.join(OBJECTS_FOLDER)),
    }
}

/// Opens the database, and brings its schema up to date.
pub(crate) async fn open_store(
    config: &ServerConfig,
    data_dir: &Path,
) -> Result<Store, StoreError> {
    let clock = config.clock.clone();
    let store = match &config.database {
        Some(url) => Store::open_postgres(url, clock).await?,
        None => Store::open_sqlite(&data_dir.join(DATABASE_FILE), clock).await?,
    };
    Ok(store.requiring_consent(config.require_consent))
}

/// Creates the data folder if it is missing, for the service's user alone. Returns its absolute path.
pub(crate) fn create_dir(path: &Path) -> Result<PathBuf, ServerError> {
    let failed = |cause| ServerError::DataDir {
        path: path.to_owned(),
        cause,
    };
    private::create_dir_all(path).map_err(failed)?;
    if private::is_open_to_others(path).map_err(failed)? {
        tracing::warn!(
            folder = %path.display(),
            "other users of this machine can look into the data folder; `chmod 700` closes it"
        );
    }
    path.canonicalize().map_err(failed)
}

/// The data folder of a running coordinator.
#[derive(Debug)]
pub(crate) struct OwnDataDir {
    /// Keeps other coordinators off the folder.
    pub lock: DataDirLock,
    /// Which of several coordinators of one database has the folder: the same after each start.
    pub instance: String,
}

/// The URL of a folder with an absolute path.
pub(crate) fn folder_url(path: &Path) -> Result<Url, ServerError> {
    Url::from_directory_path(path)
        .map_err(|()| ServerError::Config(format!("{} is not absolute", path.display())))
}
