//! Binds a store of objects to a database by hand.

use crate::data_dir::{DATABASE_FILE, DataDirLock, create_dir, objects_url, open_store};
use crate::objects::place::ObjectsPlace;
use crate::{ServerConfig, ServerError};
use url::Url;
use yoto_store::binding;

/// Binds the store of objects of `config` to its database, for an operator who has moved or lost the objects, or whose
/// database replaces the one to which they belonged. Coordinators that use both are accepted afterwards, and those of the other database are
/// refused. Returns where the objects are.
///
/// # Errors
/// When there is no database, a coordinator has the data folder, or the database or the store can't be used.
pub async fn adopt(config: &ServerConfig) -> Result<Url, ServerError> {
    if config.database.is_none() && !config.data_dir.join(DATABASE_FILE).is_file() {
        return Err(ServerError::NoDatabase(config.data_dir.clone()));
    }
    let data_dir = create_dir(&config.data_dir)?;
    let lock = DataDirLock::take(&data_dir)?;
    let url = objects_url(config, &data_dir)?;
    let (_, objects) = ObjectsPlace::open(&url, config).await?;
    let store = open_store(config, &data_dir).await?;
    let adopted = binding::adopt(&objects, &store).await;
    store.close().await;
    lock.release();
    adopted.map(|_| url).map_err(ServerError::from)
}
