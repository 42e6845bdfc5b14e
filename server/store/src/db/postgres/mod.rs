//! PostgreSQL: many writers, of which those that change the same thing wait for each other's locks.
//!
//! Transactions are READ COMMITTED with explicit locks. A script locks before it reads what it decides about (`Lock`), so each
//! of its later statements sees the newest state of that. SERIALIZABLE would need no locks, but every lease counts the queue
//! and the running jobs of all owners, which any other lease changes: most of them would be rolled back and run again.

mod advice;
mod answer;
mod connections;
mod failures;
mod guard;
mod lost;
mod migrations;
mod notices;
#[cfg(test)]
mod schema_tests;
mod url;

pub use notices::Listener;
pub use url::{PostgresUrl, UrlError};

use super::schema::{self, Steps};
use super::statement::query;
use super::{Lock, Statement};
use crate::StoreError;
use answer::{PATIENCE, within};
use failures::During;
use guard::Guard;
use lost::LastLoss;
use sqlx::pool::PoolConnection;
use sqlx::postgres::{PgConnection, PgRow};
use sqlx::{Executor, PgPool, Postgres as Db, Row, Transaction};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Longest time to an answer that tells the time well.
const QUICK: Duration = Duration::from_millis(250);

/// An open database.
#[derive(Debug)]
pub(crate) struct Postgres {
    pool: PgPool,
    guard: Guard,
    /// When this was opened, by a clock that nobody sets.
    opened: Instant,
    /// The database's time when this was opened, by the last read of its clock, as the bits of an `f64`; NaN before the first.
    since: AtomicU64,
    /// Longest wait for an answer.
    patience: Duration,
    losses: LastLoss,
}

/// A connection of the pool, with or without a transaction. If an answer takes too long, it is given up.
#[derive(Debug)]
pub(crate) struct Connection {
    held: Held,
    patience: Duration,
    losses: LastLoss,
}

#[derive(Debug)]
enum Held {
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
    pub(crate) async fn open(url: &PostgresUrl) -> Result<Self, StoreError> {
        Self::open_with(url, &migrations::steps()).await
    }

    async fn open_with(url: &PostgresUrl, steps: &Steps) -> Result<Self, StoreError> {
        let options = connections::options(url)?;
        let losses = LastLoss::default();
        let pool = connections::pool(options.clone(), PATIENCE, losses.clone()).await?;
        let pending = async || migrations::are_pending(&pool, steps).await;
        let upgrade = async || migrations::run(&pool, steps).await;
        let guard = Guard::take(options, pending, upgrade).await?;
        Ok(Self::new(pool, guard, PATIENCE, losses))
    }

    fn new(pool: PgPool, guard: Guard, patience: Duration, losses: LastLoss) -> Self {
        Self {
            pool,
            guard,
            opened: Instant::now(),
            since: AtomicU64::new(f64::NAN.to_bits()),
            patience,
            losses,
        }
    }

    fn connection(&self, held: Held) -> Connection {
        Connection {
            held,
            patience: self.patience,
            losses: self.losses.clone(),
        }
    }

    /// Opens the database for reads, unless its schema has to be brought up to date.
    pub(crate) async fn inspect(url: &PostgresUrl) -> Result<Self, StoreError> {
        let options = connections::options(url)?;
        let losses = LastLoss::default();
        let pool = connections::pool(options.clone(), PATIENCE, losses.clone()).await?;
        let steps = migrations::steps();
        let pending = async || match migrations::are_pending(&pool, &steps).await? {
            true => Err(schema::outdated()),
            false => Ok(false),
        };
        let guard = Guard::take(options, pending, async || Ok(())).await?;
        Ok(Self::new(pool, guard, PATIENCE, losses))
    }

    pub(crate) async fn read(&self) -> Result<Connection, StoreError> {
        let connection = self.pool.acquire().await;
        let connection = connection.during("waiting for a database connection")?;
        Ok(self.connection(Held::Single(connection)))
    }

    pub(crate) async fn snapshot(&self) -> Result<Connection, StoreError> {
        self.begin("BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY")
            .await
    }

    pub(crate) async fn write(&self) -> Result<Connection, StoreError> {
        self.guard.check()?;
        self.begin("BEGIN ISOLATION LEVEL READ COMMITTED READ WRITE")
            .await
    }

    /// A connection for one statement that writes.
    pub(crate) async fn write_alone(&self) -> Result<Connection, StoreError> {
        self.guard.check()?;
        self.read().await
    }

    async fn begin(&self, statement: &'static str) -> Result<Connection, StoreError> {
        let tx = within(self.patience, self.pool.begin_with(statement)).await;
        Ok(self.connection(Held::Transaction {
            inner: self.losses.noted(tx).during("starting a transaction")?,
            failed: false,
        }))
    }

    /// Sends a text to all coordinators.
    pub(crate) async fn notify(&self, text: &str) -> Result<(), StoreError> {
        notices::notify(&self.pool, text).await
    }

    /// Receives the texts of all coordinators.
    pub(crate) async fn listen(&self) -> Result<Listener, StoreError> {
        Listener::open(&self.pool, self.patience).await
    }

    /// Makes sure that no coordinator of another version has the database.
    pub(crate) async fn renew(&self) -> Result<(), StoreError> {
        self.guard.renew(migrations::are_known(&self.pool)).await
    }

    /// The database's time, which is kept for [`Self::estimate`].
    pub(crate) async fn now(&self, connection: &mut Connection) -> Result<f64, StoreError> {
        let action = "reading the database's clock";
        let statement = "SELECT extract(epoch FROM clock_timestamp())::float8 AS now";
        let asked = self.opened.elapsed();
        let row = within(self.patience, connection.get().fetch_one(statement)).await;
        let row = self.losses.noted(row).during(action)?;
        let now: f64 = row.try_get("now").during(action)?;
        let answered = self.opened.elapsed();
        // When the database looked at its clock is known as well as the answer was quick.
        let since = now - (asked + answered).as_secs_f64() / 2.0;
        let known = f64::from_bits(self.since.load(Ordering::Relaxed));
        let tells =
            answered - asked < QUICK || (since - known).abs() > (answered - asked).as_secs_f64();
        if tells || known.is_nan() {
            self.since.store(since.to_bits(), Ordering::Relaxed);
        }
        Ok(now)
    }

    /// The database's time, without a question to the database; the coordinator's time `own`, if its clock was never read.
    pub(crate) fn estimate(&self, own: f64) -> f64 {
        match f64::from_bits(self.since.load(Ordering::Relaxed)) {
            since if since.is_nan() => own,
            since => since + self.opened.elapsed().as_secs_f64(),
        }
    }

    pub(crate) async fn close(&self) {
        self.pool.close().await;
        self.guard.release().await;
    }
}

impl Connection {
    fn get(&mut self) -> &mut PgConnection {
        match &mut self.held {
            Held::Single(it) => it,
            Held::Transaction { inner, .. } => inner,
        }
    }

    /// The result of a statement. A failed one is noted.
    fn noted<T>(&mut self, result: Result<T, sqlx::Error>) -> Result<T, sqlx::Error> {
        if let (Held::Transaction { failed, .. }, Err(_)) = (&mut self.held, &result) {
            *failed = true;
        }
        self.losses.noted(result)
    }

    /// Waits for the lock: of a row, or one of the program's own where there is no row. That of a row does not exclude new
    /// rows that refer to it, which take KEY SHARE locks. After a wait for one of the program's own, returns the database's
    /// time: what one transaction after another writes there has times in their order.
    pub(crate) async fn lock(&mut self, lock: Lock<'_>) -> Result<Option<f64>, StoreError> {
        let action = "waiting for a lock";
        let (statement, id) = match lock {
            // Not 0, which is the coordinators' lock.
            Lock::Reaping => return self.lock_own(1).await.during(action),
            Lock::Forgetting => return self.lock_own(2).await.during(action),
            Lock::ObjectStore => return self.lock_own(3).await.during(action),
            Lock::Audit => return self.lock_own(4).await.during(action),
            Lock::Quota(tenant) => (
                "SELECT 1 FROM quotas WHERE tenant = $1 FOR NO KEY UPDATE",
                tenant,
            ),
            Lock::Job(id) => ("SELECT 1 FROM jobs WHERE id = $1 FOR NO KEY UPDATE", id),
            Lock::Model(id) => ("SELECT 1 FROM models WHERE id = $1 FOR NO KEY UPDATE", id),
            Lock::Subject(id) => ("SELECT 1 FROM subjects WHERE id = $1 FOR NO KEY UPDATE", id),
            Lock::Capture(id) => ("SELECT 1 FROM captures WHERE id = $1 FOR NO KEY UPDATE", id),
        };
        let statement = sqlx::query(statement).bind(id);
        let locked = within(self.patience, statement.execute(self.get())).await;
        self.losses.noted(locked).during(action)?;
        Ok(None)
    }

    async fn lock_own(&mut self, number: i32) -> Result<Option<f64>, sqlx::Error> {
        let patience = self.patience;
        let row = sqlx::query(
            "SELECT pg_advisory_xact_lock($1, $2), extract(epoch FROM clock_timestamp())::float8 AS now",
        )
        .bind(guard::PROGRAM)
        .bind(number)
        .fetch_one(self.get());
        let row = within(patience, row).await?;
        row.try_get("now").map(Some)
    }

    pub(crate) async fn row(
        &mut self,
        statement: Statement,
        action: &'static str,
    ) -> Result<Option<PgRow>, StoreError> {
        let row = within(
            self.patience,
            query::<Db>(statement).fetch_optional(self.get()),
        )
        .await;
        self.noted(row).during(action)
    }

    pub(crate) async fn rows(
        &mut self,
        statement: Statement,
        action: &'static str,
    ) -> Result<Vec<PgRow>, StoreError> {
        let rows = within(self.patience, query::<Db>(statement).fetch_all(self.get())).await;
        self.noted(rows).during(action)
    }

    pub(crate) async fn execute(
        &mut self,
        statement: Statement,
        action: &'static str,
    ) -> Result<u64, StoreError> {
        let done = within(self.patience, query::<Db>(statement).execute(self.get())).await;
        Ok(self.noted(done).during(action)?.rows_affected())
    }

    /// Commits a transaction. A connection without one has nothing to commit.
    pub(crate) async fn commit(self) -> Result<(), StoreError> {
        match self.held {
            Held::Single(_) => Ok(()),
            Held::Transaction { failed: true, .. } => Err(StoreError::Database {
                action: "committing a transaction",
                cause: "one of its statements has failed".into(),
            }),
            Held::Transaction { inner, .. } => {
                within(self.patience, inner.commit()).await.committing()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::db::sql;
    use tokio::time::sleep;
    use yoto_test_postgres::Database;

    /// A database whose processes are stopped answers nothing and ends no connection, as one behind a firewall that drops
    /// packets.
    #[tokio::test]
    async fn a_database_that_does_not_answer_fails_calls_and_keeps_no_connection() {
        let Some(database) = Database::create_durable() else {
            eprintln!("skipped: no PostgreSQL");
            return;
        };
        let patience = Duration::from_secs(1);
        let url = database.url().parse().expect("an address");
        let options = connections::options(&url).expect("good");
        let losses = LastLoss::default();
        let pool = connections::pool(options.clone(), patience, losses.clone())
            .await
            .expect("connects");
        let never = async || panic!("it is up to date");
        let guard = Guard::take(options, async || Ok(false), never).await;
        let store = Postgres::new(pool, guard.expect("it is free"), patience, losses);

        let mut reading = store.read().await.expect("a connection");
        let mut writing = store.write().await.expect("a connection");
        database.stop(true);
        let one = || sql("SELECT 1 AS one");
        let (read, written) = tokio::join!(
            reading.rows(one(), "reading"),
            writing.execute(one(), "writing"),
        );
        let until = Instant::now() + 20 * patience;
        drop((reading, writing));
        while store.pool.size() > 0 && Instant::now() < until {
            sleep(patience / 10).await;
        }
        let left = store.pool.size();
        database.stop(false);
        for error in [read.err(), written.err()] {
            let error = error.expect("nobody answers");
            let may_retry = matches!(
                error,
                StoreError::Unavailable {
                    rolled_back: true,
                    ..
                }
            );
            assert!(may_retry, "{error}");
        }
        assert_eq!(left, 0, "connections that lead nowhere are kept");
        let mut reading = store.read().await.expect("a connection");
        reading
            .row(one(), "reading")
            .await
            .expect("it answers again");
    }
}
