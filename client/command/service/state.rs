//! Where a service has its state: the options of every command that opens it.

use clap::Args;
use std::path::PathBuf;
use url::Url;
use yoto_server::PostgresUrl;

/// Options that name the data folder and the database.
#[derive(Debug, Args)]
pub(crate) struct StateArgs {
    /// Folder of the service for database and objects; `yoto serve` creates it if missing.
    #[arg(
        long,
        env = "YOTO_DATA",
        value_name = "DIR",
        default_value = "./yoto-data"
    )]
    pub data: PathBuf,
    /// PostgreSQL database, postgres://USER@HOST/NAME, instead of SQLite in the data folder. A
    /// password can be in PGPASSWORD or ~/.pgpass.
    #[arg(
        long,
        value_name = "URL",
        env = "YOTO_DATABASE",
        hide_env_values = true
    )]
    pub database: Option<PostgresUrl>,
}

/// The option that names another object store.
#[derive(Debug, Args)]
pub(crate) struct ObjectsArgs {
    /// Store for objects, s3://BUCKET/PREFIX or file:///FOLDER, instead of objects/ in the data folder.
    /// Credentials are in the environment (AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY), never in the URL.
    #[arg(
        long,
        visible_alias = "store",
        value_name = "URL",
        env = "YOTO_OBJECTS",
        hide_env_values = true
    )]
    pub objects: Option<Url>,
}
