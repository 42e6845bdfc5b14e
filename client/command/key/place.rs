//! Where keys are managed: through a service, or in its database on its own host.

use crate::args::Server;
use clap::Args;
#[cfg(feature = "embedded")]
use std::path::PathBuf;
use yoto_client::YotoClient;
use yoto_proto::v1::{CreateKeyRequest, CreateKeyResponse, Key};
#[cfg(feature = "embedded")]
use yoto_server::{KeyStore, PostgresUrl};

/// The service whose keys are managed.
#[derive(Debug, Args)]
pub(super) struct KeyStoreArgs {
    /// Open the database in the service's data folder, on its host. The service may be running. Run this as the
    /// service's user.
    #[cfg(feature = "embedded")]
    #[arg(long, value_name = "DIR", conflicts_with = "database")]
    data: Option<PathBuf>,
    /// Open the service's database in PostgreSQL, postgres://USER@HOST/NAME. The service may be running.
    #[cfg(feature = "embedded")]
    #[arg(long, value_name = "URL")]
    database: Option<PostgresUrl>,
    #[command(flatten)]
    server: Server,
}

/// The keys of a service.
pub(super) enum Keys {
    Service(YotoClient),
    #[cfg(feature = "embedded")]
    Database(KeyStore),
}

impl KeyStoreArgs {
    pub(super) async fn open(&self) -> anyhow::Result<Keys> {
        #[cfg(feature = "embedded")]
        match (&self.data, &self.database) {
            (Some(folder), _) => return Ok(Keys::Database(KeyStore::in_folder(folder).await?)),
            (None, Some(url)) => return Ok(Keys::Database(KeyStore::in_postgres(url).await?)),
            (None, None) => {}
        }
        Ok(Keys::Service(self.server.connect().await?))
    }
}

impl Keys {
    pub(super) async fn create(&self, new: CreateKeyRequest) -> anyhow::Result<CreateKeyResponse> {
        match self {
            Self::Service(client) => Ok(client.create_key(new).await?),
            #[cfg(feature = "embedded")]
            Self::Database(keys) => Ok(keys.create(new).await?),
        }
    }

    pub(super) async fn list(&self, tenant: &str) -> anyhow::Result<Vec<Key>> {
        match self {
            Self::Service(client) => Ok(client.list_keys(tenant).await?),
            #[cfg(feature = "embedded")]
            Self::Database(keys) => Ok(keys.list(tenant).await?),
        }
    }

    pub(super) async fn revoke(&self, name: &str) -> anyhow::Result<Key> {
        match self {
            Self::Service(client) => Ok(client.revoke_key(name).await?),
            #[cfg(feature = "embedded")]
            Self::Database(keys) => Ok(keys.revoke(name).await?),
        }
    }
}
