//! Keys in a service's database, for its operator on its own host: so the first key is made, and a lost one replaced.

use super::on_host;
use crate::api::new_key;
use crate::error::ServerError;
use std::path::Path;
use yoto_process::clock::{Clock, SystemClock};
use yoto_proto::names::Collection;
use yoto_proto::v1::{CreateKeyRequest, CreateKeyResponse, Key};
use yoto_request::RequestError;
use yoto_store::{NewAuditEntry, Page, PostgresUrl, Store, Tenant};

/// What the audit log has as the calls of this module, which are made on the service's own host.
const CREATE: &str = "yoto key create";
const REVOKE: &str = "yoto key revoke";

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
        let store = on_host::in_folder(folder).await?;
        Ok(Self { store })
    }

    /// Those in a database of PostgreSQL.
    ///
    /// # Errors
    /// When the database can't be reached, or is in use by a coordinator of another version.
    pub async fn in_postgres(url: &PostgresUrl) -> Result<Self, ServerError> {
        let store = on_host::in_postgres(url).await?;
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
        let (new, secret) = new_key(&request, SystemClock.now()).map_err(told)?;
        let tenant = tenant(&request.tenant)?;
        let begun = self.begin(&tenant, CREATE, "").await?;
        let key = self.store.create_key(&tenant, &new).await?;
        self.end(begun, &key.name).await?;
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
        let begun = self.begin(&Tenant::default(), REVOKE, name).await?;
        let key = self.store.revoke_key(None, id).await?;
        self.end(begun, name).await?;
        Ok(key)
    }

    /// Records in the audit log that a key is created or revoked here.
    async fn begin(
        &self,
        tenant: &Tenant,
        call: &str,
        names: &str,
    ) -> Result<NewAuditEntry, ServerError> {
        let entry = NewAuditEntry {
            tenant: tenant.id().to_owned(),
            key: String::new(),
            call: call.to_owned(),
            names: names.to_owned(),
            began: None,
            outcome: String::new(),
        };
        let numbers = self
            .store
            .append_audit(std::slice::from_ref(&entry))
            .await?;
        Ok(NewAuditEntry {
            began: numbers.first().copied(),
            ..entry
        })
    }

    /// Records that it is done. Its end is missing if it failed.
    async fn end(&self, begun: NewAuditEntry, name: &str) -> Result<(), ServerError> {
        let entry = NewAuditEntry {
            names: name.to_owned(),
            outcome: "OK".to_owned(),
            ..begun
        };
        self.store.append_audit(&[entry]).await?;
        Ok(())
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
