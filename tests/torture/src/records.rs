//! Reads what only workers know, tokens of leases and keys of objects, from the service's database.

use anyhow::{Context, Result};
use sqlx::postgres::PgConnectOptions;
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{AssertSqlSafe, ConnectOptions};
use std::path::PathBuf;
use yoto_proto::names::{Collection, parse_checkpoint};
use yoto_proto::v1::ObjectRef;

/// The records of a service.
#[derive(Debug, Clone)]
pub(crate) enum Records {
    /// In a file of SQLite.
    Sqlite(PathBuf),
    /// In a database of PostgreSQL, by its address.
    Postgres(String),
}

/// The rows of a statement that both databases read.
macro_rules! rows {
    ($records:expr, $columns:ty, $statement:expr, $($value:expr),+) => {
        match $records {
            Records::Sqlite(file) => {
                let options = SqliteConnectOptions::new().filename(file).read_only(true);
                let mut connection = options.connect().await.context("reading the database")?;
                let query = sqlx::query_as::<_, $columns>(AssertSqlSafe($statement.to_owned()));
                query$(.bind($value))+.fetch_all(&mut connection).await?
            }
            Records::Postgres(url) => {
                let options: PgConnectOptions = url.parse().context("the database's address")?;
                let mut connection = options.connect().await.context("reading the database")?;
                let query = sqlx::query_as::<_, $columns>(AssertSqlSafe($statement.to_owned()));
                query$(.bind($value))+.fetch_all(&mut connection).await?
            }
        }
    };
}

impl Records {
    /// The tokens of all leases of `jobs/{id}`, oldest first. Attempt number n has the n-th.
    ///
    /// # Errors
    /// When the database can't be read.
    pub(crate) async fn tokens(&self, job: &str) -> Result<Vec<u64>> {
        let job = Collection::Jobs.parse(job)?;
        let statement = "SELECT lease FROM job_attempts WHERE job = $1 ORDER BY lease";
        let rows: Vec<(i64,)> = rows!(self, (i64,), statement, job);
        rows.into_iter()
            .map(|(token,)| Ok(u64::try_from(token)?))
            .collect()
    }

    /// The manifest of a checkpoint; `None` if the checkpoint was removed.
    ///
    /// # Errors
    /// When the database can't be read.
    pub(crate) async fn manifest(&self, checkpoint: &str) -> Result<Option<ObjectRef>> {
        let (model, step) = parse_checkpoint(checkpoint)?;
        let step = i64::try_from(step)?;
        let statement = "SELECT manifest_key, manifest_bytes, manifest_sha256 FROM checkpoints
             WHERE model = $1 AND step = $2";
        type Columns = (String, i64, String);
        let rows: Vec<Columns> = rows!(self, Columns, statement, model, step);
        let Some((key, bytes, sha256)) = rows.into_iter().next() else {
            return Ok(None);
        };
        Ok(Some(ObjectRef {
            key,
            bytes: u64::try_from(bytes)?,
            sha256,
        }))
    }
}
