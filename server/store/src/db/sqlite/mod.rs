//! SQLite: one process, one file, durable at every commit.
//!
//! All writes go through one connection and start with `BEGIN IMMEDIATE`, so a write never fails because of an earlier read;
//! readers have their own connections and never wait.

mod connections;
mod failures;
mod migrations;
#[cfg(test)]
mod running_upgrade_tests;
#[cfg(test)]
mod upgrade_tests;

#[cfg(test)]
pub(super) use migrations::steps;

use super::Statement;
use super::schema::{self, Steps};
use super::statement::query;
use crate::StoreError;
use failures::During;
use sqlx::pool::PoolConnection;
use sqlx::sqlite::{SqliteConnection, SqliteRow};
use sqlx::{SqlitePool, Transaction};
use std::path::Path;

/// An open file.
#[derive(Debug)]
pub(crate) struct Sqlite {
    writer: SqlitePool,
    readers: SqlitePool,
}

/// A connection, with or without a transaction.
#[derive(Debug)]
pub(crate) enum Connection {
    /// Each statement is for itself.
    Single(PoolConnection<sqlx::Sqlite>),
    /// A transaction, which is rolled back unless it is committed.
    Transaction(Transaction<'static, sqlx::Sqlite>),
}

impl Sqlite {
    /// Opens the file, creating it and bringing its schema up to date.
    pub(crate) async fn open(path: &Path) -> Result<Self, StoreError> {
        Self::open_with(path, &migrations::steps()).await
    }

    async fn open_with(path: &Path, steps: &Steps) -> Result<Self, StoreError> {
        let writer = connections::writer(path).await?;
        migrations::run(&writer, steps).await?;
        let readers = connections::readers(path).await?;
        Ok(Self { writer, readers })
    }

    /// Opens a file whose schema is that of this program.
    pub(crate) async fn open_as_it_is(path: &Path) -> Result<Self, StoreError> {
        if !path.is_file() {
            return Err(StoreError::Unusable(format!(
                "{} does not exist: start `yoto serve` once, or name the folder of its --data",
                path.display()
            )));
        }
        let writer = connections::writer(path).await?;
        let readers = connections::readers(path).await?;
        match migrations::are_pending(&readers).await? {
            true => Err(schema::outdated()),
            false => Ok(Self { writer, readers }),
        }
    }

    /// Opens an existing file for reads. What writes fails.
    pub(crate) async fn inspect(path: &Path) -> Result<Self, StoreError> {
        let readers = connections::readers(path).await?;
        match migrations::are_pending(&readers).await? {
            true => Err(schema::outdated()),
            false => Ok(Self {
                writer: readers.clone(),
                readers,
            }),
        }
    }

    pub(crate) async fn read(&self) -> Result<Connection, StoreError> {
        let connection = self.readers.acquire().await;
        let connection = connection.during("waiting for a database connection")?;
        Ok(Connection::Single(connection))
    }

    pub(crate) async fn snapshot(&self) -> Result<Connection, StoreError> {
        let tx = self.readers.begin().await;
        Ok(Connection::Transaction(tx.during("starting to read")?))
    }

    pub(crate) async fn write(&self) -> Result<Connection, StoreError> {
        let tx = self.writer.begin_with("BEGIN IMMEDIATE").await;
        let tx = tx.during("starting a transaction")?;
        Ok(Connection::Transaction(tx))
    }

    pub(crate) async fn close(&self) {
        self.readers.close().await;
        self.writer.close().await;
    }
}

impl Connection {
    fn get(&mut self) -> &mut SqliteConnection {
        match self {
            Self::Single(it) => it,
            Self::Transaction(it) => it,
        }
    }

    pub(crate) async fn row(
        &mut self,
        statement: Statement,
        action: &'static str,
    ) -> Result<Option<SqliteRow>, StoreError> {
        let query = query::<sqlx::Sqlite>(statement);
        query.fetch_optional(self.get()).await.during(action)
    }

    pub(crate) async fn rows(
        &mut self,
        statement: Statement,
        action: &'static str,
    ) -> Result<Vec<SqliteRow>, StoreError> {
        let query = query::<sqlx::Sqlite>(statement);
        query.fetch_all(self.get()).await.during(action)
    }

    pub(crate) async fn execute(
        &mut self,
        statement: Statement,
        action: &'static str,
    ) -> Result<u64, StoreError> {
        let done = query::<sqlx::Sqlite>(statement).execute(self.get()).await;
        Ok(done.during(action)?.rows_affected())
    }

    /// Commits a transaction. A connection without one has nothing to commit.
    pub(crate) async fn commit(self) -> Result<(), StoreError> {
        match self {
            Self::Single(_) => Ok(()),
            Self::Transaction(tx) => tx.commit().await.during("committing a transaction"),
        }
    }
}
