//! Keys in a service's database, for its operator on its own host. Whoever can open the database can do everything anyway, so
//! no key is asked for: so the first key is made, and a lost one replaced.

use crate::DATABASE_FILE;
use crate::api::new_key;
use crate::clock::SystemClock;
use crate::error::{RequestError, ServerError};
use crate::store::{Page, PostgresUrl, Store};
use crate::tenant::Tenant;
use std::path::Path;
use std::sync::Arc;
use yoto_proto::names::Collection;
use yoto_proto::v1::{CreateKeyRequest, CreateKeyResponse, Key};

/// The keys in a database. Its service may run, and knows of a change within a second.
pub struct KeyStore {
    store: Store,
}

impl KeyStore {
    /// Those in the SQLite database of a data folder.
    ///
    /// # Errors
    /// When no service was in the folder, or one of an earlier version.
    pub async fn in_folder(folder: &Path) -> Result<Self, ServerError> {
        let path = folder.join(DATABASE_FILE);
        let store = Store::open_sqlite_as_it_is(&path, Arc::new(SystemClock)).await?;
        Ok(Self { store })
    }

    /// Those in a database of PostgreSQL.
    ///
    /// # Errors
    /// When the database can't be reached, or is in use by a coordinator of another version.
    pub async fn in_postgres(url: &PostgresUrl) -> Result<Self, ServerError> {
        let store = Store::open_postgres(url, Arc::new(SystemClock)).await?;
        Ok(Self { store })
    }

    /// Creates a key, of the tenant `default` unless the request names another.
    ///
    /// # Errors
    /// When the request is malformed, or the database fails.
    pub async fn create(
        &self,
        request: CreateKeyRequest,
    ) -> Result<CreateKeyResponse, ServerError> {
        let (new, secret) = new_key(&request).map_err(told)?;
        let key = self
            .store
            .create_key(&tenant(&request.tenant)?, &new)
            .await?;
        Ok(CreateKeyResponse {
            key: Some(key),
            secret,
        })
    }

    /// The keys of a tenant, newest first; of the tenant `default` without a name.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn list(&self, named: &str) -> Result<Vec<Key>, ServerError> {
        let all = Page {
            limit: u32::MAX,
            after: None,
        };
        let found = self.store.keys(&tenant(named)?, all).await?;
        Ok(found.into_iter().map(|it| it.item).collect())
    }

    /// Revokes a key, by its resource name.
    ///
    /// # Errors
    /// When there is no such key, or the database fails.
    pub async fn revoke(&self, name: &str) -> Result<Key, ServerError> {
        let id = Collection::Keys.parse(name);
        let id = id.map_err(|error| ServerError::Key(error.to_string()))?;
        Ok(self.store.revoke_key(None, id).await?)
    }

    /// Closes the database.
    pub async fn close(self) {
        self.store.close().await;
    }
}

fn tenant(named: &str) -> Result<Tenant, ServerError> {
    match named {
        "" => Ok(Tenant::default()),
        named => Tenant::new(named).ok_or_else(|| {
            ServerError::Key(format!("{named}: a tenant is 1 to 64 of a-z, 0-9 and -"))
        }),
    }
}

fn told(error: RequestError) -> ServerError {
    ServerError::Key(error.to_string())
}
