//! The database, as narrow as the store's scripts need it: statements of text and values, rows of typed columns, one clock,
//! one order of locks. A script is written once for all databases; what differs between them is in a driver's folder.
//!
//! | here | what a driver brings |
//! |---|---|
//! | [`Database`] | opening, and a transaction that reads or writes |
//! | [`Tx`] | rows of a statement, the number of changed rows, commit, waiting for a lock |
//! | [`Row`] | the columns of its rows |
//! | `failures`, `migrations` | the classes of its errors, its schema |
//!
//! SQLite is the only driver.

mod locks;
mod row;
pub mod sqlite;
mod statement;
mod tx;

pub use locks::Lock;
pub use row::{Row, integer, state, timestamp};
pub use statement::{Statement, sql};
pub use tx::Tx;

use crate::clock::Clock;
use crate::store::StoreError;
use sqlite::Sqlite;
use std::path::Path;
use std::sync::Arc;

/// An open database. Its clock is the only one of the store.
#[derive(Debug)]
pub struct Database {
    driver: Driver,
    clock: Arc<dyn Clock>,
}

#[derive(Debug)]
enum Driver {
    Sqlite(Sqlite),
}

impl Database {
    /// Opens a file of SQLite, creating it and bringing its schema up to date.
    ///
    /// # Errors
    /// When the file can't be opened, or holds a schema that is newer or altered.
    pub async fn open_sqlite(path: &Path, clock: Arc<dyn Clock>) -> Result<Self, StoreError> {
        let driver = Driver::Sqlite(Sqlite::open(path).await?);
        Ok(Self { driver, clock })
    }

    /// The clock of the coordinator, with which [`Tx::now`] is set.
    pub fn clock(&self) -> &dyn Clock {
        &*self.clock
    }

    /// Statements that read. Each sees the newest state.
    ///
    /// # Errors
    /// When no connection is free for a long time.
    pub async fn read(&self) -> Result<Tx, StoreError> {
        let connection = match &self.driver {
            Driver::Sqlite(it) => it.read().await?,
        };
        Ok(Tx::begin(connection, self.clock.now()))
    }

    /// Statements that read, all of which see the same state.
    ///
    /// # Errors
    /// When no connection is free for a long time.
    pub async fn snapshot(&self) -> Result<Tx, StoreError> {
        let connection = match &self.driver {
            Driver::Sqlite(it) => it.snapshot().await?,
        };
        Ok(Tx::begin(connection, self.clock.now()))
    }

    /// A transaction that writes. Unless it is [committed](Tx::commit), it changes nothing.
    ///
    /// # Errors
    /// When the database is locked for a long time.
    pub async fn write(&self) -> Result<Tx, StoreError> {
        let connection = match &self.driver {
            Driver::Sqlite(it) => it.write().await?,
        };
        // Read once it has the lock: transactions have times in the order in which they are written.
        Ok(Tx::begin(connection, self.clock.now()))
    }

    /// Waits for running statements and closes the database.
    pub async fn close(&self) {
        match &self.driver {
            Driver::Sqlite(it) => it.close().await,
        }
    }
}
