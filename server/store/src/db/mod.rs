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
//! The drivers are SQLite, for one process on one machine, and PostgreSQL.

mod locks;
pub(crate) mod postgres;
mod row;
mod schema;
pub(crate) mod sqlite;
mod statement;
#[cfg(test)]
mod taken_over;
mod tx;

pub(crate) use locks::Lock;
pub use postgres::{Listener, PostgresUrl, UrlError};
pub(crate) use row::{Row, integer, state, timestamp};
pub(crate) use statement::{Statement, Value, claimed, sql};
pub(crate) use tx::{Column, Tx};

use crate::StoreError;
use postgres::Postgres;
use sqlite::Sqlite;
use std::path::Path;
use std::sync::Arc;
use yoto_process::clock::Clock;

/// An open database. Its clock is the only one of the store.
#[derive(Debug)]
pub(crate) struct Database {
    driver: Driver,
    clock: Arc<dyn Clock>,
}

#[derive(Debug)]
enum Driver {
    Sqlite(Sqlite),
    Postgres(Box<Postgres>),
}

impl Database {
    /// Opens a file of SQLite, creating it and bringing its schema up to date. The coordinator's clock tells the time.
    ///
    /// # Errors
    /// When the file can't be opened, or is of another program or a newer version.
    pub(crate) async fn open_sqlite(
        path: &Path,
        clock: Arc<dyn Clock>,
    ) -> Result<Self, StoreError> {
        let driver = Driver::Sqlite(Sqlite::open(path).await?);
        Ok(Self { driver, clock })
    }

    /// Opens a file of SQLite whose schema is that of this program.
    ///
    /// # Errors
    /// When there is no such file, or its schema is another.
    pub(crate) async fn open_sqlite_as_it_is(
        path: &Path,
        clock: Arc<dyn Clock>,
    ) -> Result<Self, StoreError> {
        let driver = Driver::Sqlite(Sqlite::open_as_it_is(path).await?);
        Ok(Self { driver, clock })
    }

    /// Opens a database of PostgreSQL and brings its schema up to date. Its own clock tells the time, unless `clock` is a
    /// test's.
    ///
    /// # Errors
    /// When the database can't be reached, is in use by a coordinator of another version, or is of another program or a newer
    /// version.
    pub(crate) async fn open_postgres(
        url: &PostgresUrl,
        clock: Arc<dyn Clock>,
    ) -> Result<Self, StoreError> {
        let driver = Driver::Postgres(Postgres::open(url).await?.into());
        Ok(Self { driver, clock })
    }

    /// Opens an existing file of SQLite for reads.
    ///
    /// # Errors
    /// When the file can't be opened, or its schema is not this version's.
    pub(crate) async fn inspect_sqlite(
        path: &Path,
        clock: Arc<dyn Clock>,
    ) -> Result<Self, StoreError> {
        let driver = Driver::Sqlite(Sqlite::inspect(path).await?);
        Ok(Self { driver, clock })
    }

    /// Opens a database of PostgreSQL for reads.
    ///
    /// # Errors
    /// When the database can't be reached, or its schema is not this version's.
    pub(crate) async fn inspect_postgres(
        url: &PostgresUrl,
        clock: Arc<dyn Clock>,
    ) -> Result<Self, StoreError> {
        let driver = Driver::Postgres(Postgres::inspect(url).await?.into());
        Ok(Self { driver, clock })
    }

    /// The file of SQLite.
    #[cfg(test)]
    fn sqlite(&self) -> &Sqlite {
        match &self.driver {
            Driver::Sqlite(it) => it,
            Driver::Postgres(_) => panic!("it is not SQLite"),
        }
    }

    /// The clock of the coordinator.
    pub(crate) fn clock(&self) -> &dyn Clock {
        &*self.clock
    }

    /// Makes sure that no coordinator of another version has the database.
    ///
    /// # Errors
    /// When one has taken it, or the database can't be reached.
    pub(crate) async fn renew(&self) -> Result<(), StoreError> {
        match &self.driver {
            // The lock of the data folder lasts as long as the process.
            Driver::Sqlite(_) => Ok(()),
            Driver::Postgres(it) => it.renew().await,
        }
    }

    /// Whether other coordinators may use the database.
    pub(crate) fn is_shared(&self) -> bool {
        matches!(self.driver, Driver::Postgres(_))
    }

    /// Sends a text to the coordinators that [listen](Self::listen), this one too.
    ///
    /// # Errors
    /// When the database can't be reached.
    pub(crate) async fn notify(&self, text: &str) -> Result<(), StoreError> {
        match &self.driver {
            Driver::Sqlite(_) => Ok(()),
            Driver::Postgres(it) => it.notify(text).await,
        }
    }

    /// Receives texts of coordinators; `None` if there can't be others.
    ///
    /// # Errors
    /// When the database can't be reached.
    pub(crate) async fn listen(&self) -> Result<Option<Listener>, StoreError> {
        match &self.driver {
            Driver::Sqlite(_) => Ok(None),
            Driver::Postgres(it) => it.listen().await.map(Some),
        }
    }

    /// Statements that read. Each sees the newest state.
    ///
    /// # Errors
    /// When no connection is free for a long time.
    pub(crate) async fn read(&self) -> Result<Tx, StoreError> {
        let driver = match &self.driver {
            Driver::Sqlite(it) => tx::Driver::Sqlite(it.read().await?),
            Driver::Postgres(it) => tx::Driver::Postgres(Box::pin(it.read()).await?),
        };
        Ok(Tx::begin(driver, self.estimate(), false))
    }

    /// Statements that read, all of which see the same state.
    ///
    /// # Errors
    /// When no connection is free for a long time.
    pub(crate) async fn snapshot(&self) -> Result<Tx, StoreError> {
        let driver = match &self.driver {
            Driver::Sqlite(it) => tx::Driver::Sqlite(it.snapshot().await?),
            Driver::Postgres(it) => tx::Driver::Postgres(Box::pin(it.snapshot()).await?),
        };
        Ok(Tx::begin(driver, self.estimate(), false))
    }

    /// A transaction that writes. Unless it is [committed](Tx::commit), it changes nothing.
    ///
    /// # Errors
    /// When the database can't be reached, or is locked for a long time.
    pub(crate) async fn write(&self) -> Result<Tx, StoreError> {
        match &self.driver {
            Driver::Sqlite(it) => {
                let connection = it.write().await?;
                // Read once it has the lock: transactions have times in the order in which they are written.
                let now = self.clock.now();
                Ok(Tx::begin(tx::Driver::Sqlite(connection), now, false))
            }
            Driver::Postgres(it) => {
                let mut connection = Box::pin(it.write()).await?;
                let of_database = self.clock.is_system();
                let now = match of_database {
                    true => Box::pin(it.now(&mut connection)).await?,
                    false => self.clock.now(),
                };
                let driver = tx::Driver::Postgres(connection);
                Ok(Tx::begin(driver, now, of_database))
            }
        }
    }

    /// A short transaction that writes, which takes the time from the last read of the database's clock and this machine's since. One that
    /// is `alone` is a single statement, which is durable by itself: PostgreSQL neither begins a transaction nor commits it. After a lost connection it
    /// is run again, and may have been carried out before, so it must do the same twice.
    ///
    /// # Errors
    /// When the database can't be reached, or is locked for a long time.
    pub(crate) async fn write_shortly(&self, alone: bool) -> Result<Tx, StoreError> {
        let Driver::Postgres(it) = &self.driver else {
            return self.write().await;
        };
        let connection = match alone {
            true => Box::pin(it.write_alone()).await?,
            false => Box::pin(it.write()).await?,
        };
        let driver = tx::Driver::Postgres(connection);
        Ok(Tx::begin(driver, self.estimate(), self.clock.is_system()))
    }

    /// The time without a question to the database: a read of PostgreSQL's clock would take as long as a statement.
    fn estimate(&self) -> f64 {
        match &self.driver {
            Driver::Sqlite(_) => self.clock.now(),
            Driver::Postgres(it) => it.estimate(self.clock.now()),
        }
    }

    /// Waits for running statements and closes the database.
    pub(crate) async fn close(&self) {
        match &self.driver {
            Driver::Sqlite(it) => it.close().await,
            Driver::Postgres(it) => it.close().await,
        }
    }
}
