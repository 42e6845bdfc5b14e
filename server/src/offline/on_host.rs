//! A service's database, opened on its own host beside the running service. Operators need no key there: a person who can
//! open the database can do everything.

use crate::data_dir::DATABASE_FILE;
use crate::error::ServerError;
use std::path::Path;
use std::sync::Arc;
use yoto_process::clock::SystemClock;
use yoto_store::{PostgresUrl, Store};

/// The SQLite database in a data folder.
///
/// # Errors
/// When no service was in the folder, or one of an earlier version.
pub(super) async fn in_folder(folder: &Path) -> Result<Store, ServerError> {
    let path = folder.join(DATABASE_FILE);
    Ok(Store::open_sqlite_as_it_is(&path, Arc::new(SystemClock)).await?)
}

/// A database of PostgreSQL.
///
/// # Errors
/// When the database can't be reached, or is in use by a coordinator of another version.
pub(super) async fn in_postgres(url: &PostgresUrl) -> Result<Store, ServerError> {
    Ok(Store::open_postgres(url, Arc::new(SystemClock)).await?)
}
