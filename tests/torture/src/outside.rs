//! What the service's processes share and did not start: a database of PostgreSQL, a store of objects.

use super::fault::Makeup;
use anyhow::{Context, Result};
use std::path::{Path, PathBuf};
use url::Url;
use yoto_server::Environment;
use yoto_server::fsck::Place;
use yoto_test_postgres::Database;
use yoto_test_s3::{BUCKET, Server};

/// Where the objects are in the bucket.
const PREFIX: &str = "yoto";

/// The outside of a fleet.
#[derive(Debug)]
pub(crate) struct Outside {
    /// PostgreSQL, a server of its own; none: a file of SQLite.
    pub database: Option<Database>,
    /// S3; none: a folder.
    pub store: Option<Server>,
    /// Folder of all data.
    folder: PathBuf,
}

impl Outside {
    /// Starts what the `makeup` says. Everything else is in `folder`.
    ///
    /// # Errors
    /// When PostgreSQL is missing.
    pub(crate) fn start(makeup: Makeup, folder: &Path) -> Result<Self> {
        let database = match makeup.postgres {
            true => {
                let made = Database::create_durable();
                Some(made.context("no PostgreSQL: apt-get install postgresql")?)
            }
            false => None,
        };
        let outside = Self {
            database,
            store: makeup.s3.then(Server::start),
            folder: folder.to_owned(),
        };
        if outside.store.is_none() {
            std::fs::create_dir_all(outside.objects())?;
        }
        Ok(outside)
    }

    /// The data folder of the coordinator with this number.
    pub(crate) fn data(&self, coordinator: usize) -> PathBuf {
        match coordinator {
            0 => self.folder.join("data"),
            more => self.folder.join(format!("data-{more}")),
        }
    }

    /// The folder with the objects, each in a file with its key.
    pub(crate) fn objects(&self) -> PathBuf {
        match &self.store {
            Some(store) => store.folder().join(PREFIX),
            None => self.data(0).join("objects"),
        }
    }

    /// Where the service's processes find the objects.
    ///
    /// # Errors
    /// When the folder's name makes no URL.
    pub(crate) fn objects_url(&self) -> Result<Url> {
        match &self.store {
            Some(_) => Ok(Url::parse(&format!("s3://{BUCKET}/{PREFIX}"))?),
            None => url_of(&self.objects()),
        }
    }

    /// Variables of the processes' environment.
    pub(crate) fn environment(&self) -> Vec<(String, String)> {
        self.store
            .as_ref()
            .map(Server::environment)
            .unwrap_or_default()
    }

    /// The address of the database, past all proxies.
    pub(crate) fn database_url(&self) -> Option<String> {
        self.database.as_ref().map(Database::url)
    }

    /// The whole service, for its check.
    ///
    /// # Errors
    /// When an address is invalid.
    pub(crate) fn place(&self) -> Result<Place> {
        let database = self.database_url().map(|url| url.parse());
        Ok(Place {
            data_dir: self.data(0),
            database: database.transpose()?,
            objects: Some(self.objects_url()?),
            environment: Environment::from(self.environment()),
        })
    }
}

/// The URL of a folder.
///
/// # Errors
/// When its name makes none.
pub(crate) fn url_of(folder: &Path) -> Result<Url> {
    let url = Url::from_directory_path(folder);
    url.map_err(|()| anyhow::anyhow!("{} is not absolute", folder.display()))
}
