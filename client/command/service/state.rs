//! Where a service has its state: the options of every command that opens it.

use clap::Args;
use std::path::PathBuf;
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
