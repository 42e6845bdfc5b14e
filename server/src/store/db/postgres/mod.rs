//! PostgreSQL: many writers, of which those that change the same thing wait for each other's locks.
//!
//! Transactions are READ COMMITTED with explicit locks. A script locks before it reads what it decides about (`Lock`), so each
//! of its later statements sees the newest state of that. SERIALIZABLE would need no locks, but every lease counts the queue
//! and the running jobs of all owners, which any other lease changes: most of them would be rolled back and run again.

mod advice;
mod connections;
mod failures;
mod guard;
mod migrations;
mod notices;
#[cfg(test)]
mod schema_tests;
mod url;

pub use notices::Listener;
pub use url::{PostgresUrl, UrlError};

use super::statement::query;
use super::{Lock, Statement, schema};
use crate::store::StoreError;
use failures::During;
use guard::Guard;
use sqlx::pool::PoolConnection;
use sqlx::postgres::{PgConnection, PgRow};
use sqlx::{Executor, PgPool, Postgres as Db, Row, Transaction};
use std::sync::atomic::{AtomicU64, Ordering};

/// An open database.
#[derive(Debug)]
pub struct Postgres {
    pool: PgPool,
    guard: Guard,
    /// Seconds by which the database's clock was last ahead of the coordinator's, as the bits of an `f64`.
    ahead: AtomicU64,
}

/// A connection, with or without a transaction.
#[derive(Debug)]
pub enum Connection {
    /// Each statement is for itself.
    Single(PoolConnection<Db>),
    /// A transaction, which is rolled back unless it is committed.
    Transaction {
        inner: Transaction<'static, Db>,
        /// Whether a statement has failed. The database answers a commit after that as if it had succeeded.
        failed: bool,
    },
}

impl Postgres {
    /// Opens the database, and brings its schema up to date. Other coordinators of this version may use it at the same time.
    pub async fn open(url: &PostgresUrl) -> Result<Self, StoreError> {
        let options = connections::options(url)?;
        let pool = connections::pool(options.clone()).await?;
        let pending = async || migrations::are_pending(&pool).await;
        let upgrade = async || migrations::run(&pool).await;
        let guard = Guard::take(options, pending, upgrade).await?;
        Ok(Self {
            pool,
            guard,
            ahead: AtomicU64::new(0.0_f64.to_bits()),
        })
    }

    /// Opens the database for reads, unless its schema has to be brought up to date.
    pub async fn inspect(url: &PostgresUrl) -> Result<Self, StoreError> {
        let options = connections::options(url)?;
        let pool = connections::pool(options.clone()).await?;
        let pending = async || match migrations::are_pending(&pool).await? {
            true => Err(schema::outdated()),
            false => Ok(false),
        };
        let guard = Guard::take(options, pending, async || Ok(())).await?;
        Ok(Self {
            pool,
            guard,
            ahead: AtomicU64::new(0.0_f64.to_bits()),
        })
    }

    pub async fn read(&self) -> Result<Connection, StoreError> {
        let connection = self.pool.acquire().await;
        let connection = connection.during("waiting for a database connection")?;
        Ok(Connection::Single(connection))
    }

    pub async fn snapshot(&self) -> Result<Connection, StoreError> {
        self.begin("BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY")
            .await
    }

    pub async fn write(&self) -> Result<Connection, StoreError> {
        self.guard.check()?;
        self.begin("BEGIN ISOLATION LEVEL READ COMMITTED READ WRITE")
            .await
    }

    async fn begin(&self, statement: &'static str) -> Result<Connection, StoreError> {
        let tx = self.pool.begin_with(statement).await;
        Ok(Connection::Transaction {
            inner: tx.during("starting a transaction")?,
            failed: false,
        })
    }

    /// Sends a text to all coordinators.
    pub async fn notify(&self, text: &str) -> Result<(), StoreError> {
        notices::notify(&self.pool, text).await
    }

    /// Receives the texts of all coordinators.
    pub async fn listen(&self) -> Result<Listener, StoreError> {
        Listener::open(&self.pool).await
    }

    /// Makes sure that no coordinator of another version has the database.
    pub async fn renew(&self) -> Result<(), StoreError> {
        self.guard.renew(migrations::are_known(&self.pool)).await
    }

    /// The database's time, and the difference to the coordinator's time `own` is kept for [`Self::estimate`].
    pub async fn now(&self, connection: &mut Connection, own: f64) -> Result<f64, StoreError> {
        let action = "reading the database's clock";
        let statement = "SELECT extract(epoch FROM clock_timestamp())::float8 AS now";
        let row = connection.get().fetch_one(statement).await.during(action)?;
        let now: f64 = row.try_get("now").during(action)?;
        self.ahead.store((now - own).to_bits(), Ordering::Relaxed);
        Ok(now)
    }

    /// The database's time at the coordinator's time `own`, without a question to the database.
    pub fn estimate(&self, own: f64) -> f64 {
        own + f64::from_bits(self.ahead.load(Ordering::Relaxed))
    }

    pub async fn close(&self) {
        self.pool.close().await;
        self.guard.release().await;
    }
}

impl Connection {
    fn get(&mut self) -> &mut PgConnection {
        match self {
            Self::Single(it) => it,
            Self::Transaction { inner, .. } => inner,
        }
    }

    /// The result of a statement. A failed one is noted.
    fn noted<T>(&mut self, result: Result<T, sqlx::Error>) -> Result<T, sqlx::Error> {
        if let (Self::Transaction { failed, .. }, Err(_)) = (self, &result) {
            *failed = true;
        }
        result
    }

    /// Waits for the lock: of a row, or one of the program's own where there is no row. That of a row does not exclude new
    /// rows that refer to it, which take KEY SHARE locks. After a wait for one of the program's own, returns the database's
    /// time: what one transaction after another writes there has times in their order.
    pub async fn lock(&mut self, lock: Lock<'_>) -> Result<Option<f64>, StoreError> {
        let action = "waiting for a lock";
        let (statement, id) = match lock {
            // Not 0, which is the coordinators' lock.
            Lock::Reaping => return self.lock_own(1).await.during(action),
            Lock::Forgetting => return self.lock_own(2).await.during(action),
            Lock::ObjectStore => return self.lock_own(3).await.during(action),
            Lock::Job(id) => ("SELECT 1 FROM jobs WHERE id = $1 FOR NO KEY UPDATE", id),
            Lock::Model(id) => ("SELECT 1 FROM models WHERE id = $1 FOR NO KEY UPDATE", id),
            Lock::Subject(id) => ("SELECT 1 FROM subjects WHERE id = $1 FOR NO KEY UPDATE", id),
            Lock::Capture(id) => ("SELECT 1 FROM captures WHERE id = $1 FOR NO KEY UPDATE", id),
        };
        let statement = sqlx::query(statement).bind(id);
        statement.execute(self.get()).await.during(action)?;
        Ok(None)
    }

    async fn lock_own(&mut self, number: i32) -> Result<Option<f64>, sqlx::Error> {
        let row = sqlx::query(
            "SELECT pg_advisory_xact_lock($1, $2), extract(epoch FROM clock_timestamp())::float8 AS now",
        )
        .bind(guard::PROGRAM)
        .bind(number)
        .fetch_one(self.get())
        .await?;
        row.try_get("now").map(Some)
    }

    pub async fn row(
        &mut self,
        statement: Statement,
        action: &'static str,
    ) -> Result<Option<PgRow>, StoreError> {
        let row = query::<Db>(statement).fetch_optional(self.get()).await;
        self.noted(row).during(action)
    }

    pub async fn rows(
        &mut self,
        statement: Statement,
        action: &'static str,
    ) -> Result<Vec<PgRow>, StoreError> {
        let rows = query::<Db>(statement).fetch_all(self.get()).await;
        self.noted(rows).during(action)
    }

    pub async fn execute(
        &mut self,
        statement: Statement,
        action: &'static str,
    ) -> Result<u64, StoreError> {
        let done = query::<Db>(statement).execute(self.get()).await;
        Ok(self.noted(done).during(action)?.rows_affected())
    }

    /// Commits a transaction. A connection without one has nothing to commit.
    pub async fn commit(self) -> Result<(), StoreError> {
        match self {
            Self::Single(_) => Ok(()),
            Self::Transaction { failed: true, .. } => Err(StoreError::Database {
                action: "committing a transaction",
                cause: "one of its statements has failed".into(),
            }),
            Self::Transaction { inner, .. } => inner.commit().await.committing(),
        }
    }
}
