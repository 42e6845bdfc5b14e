//! Reads what only workers know, tokens of leases and keys of objects, from the coordinator's database.

use anyhow::{Context, Result};
use prost::Message;
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{ConnectOptions, Row, SqliteConnection};
use std::path::PathBuf;
use yoto_proto::names::{Collection, parse_checkpoint};
use yoto_proto::v1::{JobResult, ObjectRef};

/// The records of a coordinator.
#[derive(Debug, Clone)]
pub struct Records {
    /// Its database.
    pub database: PathBuf,
}

impl Records {
    async fn open(&self) -> Result<SqliteConnection> {
        let options = SqliteConnectOptions::new()
            .filename(&self.database)
            .read_only(true);
        options.connect().await.context("reading the database")
    }

    /// The tokens of all leases of `jobs/{id}`, oldest first. The n-th is that of the attempt with number n.
    ///
    /// # Errors
    /// When the database can't be read.
    pub async fn tokens(&self, job: &str) -> Result<Vec<u64>> {
        let rows = sqlx::query("SELECT lease FROM job_attempts WHERE job = ?1 ORDER BY lease")
            .bind(Collection::Jobs.parse(job)?)
            .fetch_all(&mut self.open().await?)
            .await?;
        let token = |row| Ok(u64::try_from(Row::try_get::<i64, _>(row, "lease")?)?);
        rows.iter().map(token).collect()
    }

    /// The manifest of a checkpoint; `None` if the checkpoint was removed.
    ///
    /// # Errors
    /// When the database can't be read.
    pub async fn manifest(&self, checkpoint: &str) -> Result<Option<ObjectRef>> {
        let (model, step) = parse_checkpoint(checkpoint)?;
        let row = sqlx::query(
            "SELECT manifest_key, manifest_bytes, manifest_sha256 FROM checkpoints
             WHERE model = ?1 AND step = ?2",
        )
        .bind(model)
        .bind(i64::try_from(step)?)
        .fetch_optional(&mut self.open().await?)
        .await?;
        let Some(row) = row else {
            return Ok(None);
        };
        Ok(Some(ObjectRef {
            key: row.try_get("manifest_key")?,
            bytes: u64::try_from(row.try_get::<i64, _>("manifest_bytes")?)?,
            sha256: row.try_get("manifest_sha256")?,
        }))
    }

    /// The result of `jobs/{id}`, with the keys of its objects; `None` if it has none.
    ///
    /// # Errors
    /// When the database can't be read.
    pub async fn result(&self, job: &str) -> Result<Option<JobResult>> {
        let row = sqlx::query("SELECT result FROM jobs WHERE id = ?1")
            .bind(Collection::Jobs.parse(job)?)
            .fetch_optional(&mut self.open().await?)
            .await?;
        let Some(row) = row else {
            return Ok(None);
        };
        let bytes: Option<&[u8]> = row.try_get("result")?;
        Ok(bytes.map(JobResult::decode).transpose()?)
    }
}
