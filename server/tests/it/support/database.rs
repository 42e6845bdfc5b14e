//! The database of a service under test: SQLite, or PostgreSQL in a second run of all tests.

use sqlx::postgres::PgConnectOptions;
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{AssertSqlSafe, ConnectOptions, Connection, PgConnection, SqliteConnection};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex, PoisonError};
use yoto_server::PostgresUrl;

/// The variable that makes all services of this process use PostgreSQL, with any value.
pub(crate) const ON_POSTGRES: &str = "YOTO_TEST_ON_POSTGRES";

/// Databases of services that were stopped, by their folders: a service in the same folder continues with it.
static STOPPED: LazyLock<Mutex<HashMap<PathBuf, Database>>> = LazyLock::new(Mutex::default);

/// A database.
pub(crate) enum Database {
    /// A file in the service's folder.
    Sqlite(PathBuf),
    /// A database on the server of this process.
    Postgres(yoto_test_postgres::Database),
}

/// A lock that keeps the service from writing.
pub(crate) enum WriteLock {
    Sqlite(SqliteConnection),
    Postgres(PgConnection),
}

impl Database {
    /// The database of a service in `folder`.
    pub(crate) fn of(folder: &Path) -> Self {
        let stopped = STOPPED
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .remove(folder);
        stopped.unwrap_or_else(|| match std::env::var_os(ON_POSTGRES) {
            None => Self::Sqlite(folder.join("yoto.db")),
            Some(_) => {
                let made = yoto_test_postgres::Database::create();
                Self::Postgres(made.expect("this run is for PostgreSQL"))
            }
        })
    }

    /// Keeps it for the next service in `folder`.
    pub(crate) fn keep(self, folder: &Path) {
        let mut stopped = STOPPED.lock().unwrap_or_else(PoisonError::into_inner);
        stopped.insert(folder.to_owned(), self);
    }

    /// The address for the service's configuration.
    pub(crate) fn url(&self) -> Option<PostgresUrl> {
        match self {
            Self::Sqlite(_) => None,
            Self::Postgres(it) => Some(it.url().parse().expect("an address")),
        }
    }

    async fn sqlite(path: &Path) -> SqliteConnection {
        let options = SqliteConnectOptions::new().filename(path);
        options.connect().await.expect("opens")
    }

    async fn postgres(database: &yoto_test_postgres::Database) -> PgConnection {
        let options: PgConnectOptions = database.url().parse().expect("an address");
        options.connect().await.expect("connects")
    }

    /// Changes it behind the service's back.
    pub(crate) async fn run(&self, statement: &str) {
        self.run_either(statement, statement).await;
    }

    /// The same by a statement for each database.
    pub(crate) async fn run_either(&self, sqlite: &str, postgres: &str) {
        let statement = |text: &str| sqlx::query(AssertSqlSafe(text.to_owned()));
        let changed = match self {
            Self::Sqlite(path) => {
                let mut connection = Self::sqlite(path).await;
                let done = sqlx::query(AssertSqlSafe(sqlite.to_owned())).execute(&mut connection);
                done.await.expect("runs").rows_affected()
            }
            Self::Postgres(it) => {
                let done = statement(postgres)
                    .execute(&mut Self::postgres(it).await)
                    .await;
                done.expect("runs").rows_affected()
            }
        };
        assert!(changed > 0, "it changes nothing");
    }

    /// Locks it for writes of the service, as another program can, until the lock is released.
    pub(crate) async fn lock_writes(&self) -> WriteLock {
        match self {
            Self::Sqlite(path) => {
                let mut connection = Self::sqlite(path).await;
                let locked = sqlx::query("BEGIN IMMEDIATE")
                    .execute(&mut connection)
                    .await;
                locked.expect("locks");
                WriteLock::Sqlite(connection)
            }
            Self::Postgres(it) => {
                let mut connection = Self::postgres(it).await;
                for statement in ["BEGIN", "LOCK TABLE service_clock IN EXCLUSIVE MODE"] {
                    let locked = sqlx::query(statement).execute(&mut connection).await;
                    locked.expect("locks");
                }
                WriteLock::Postgres(connection)
            }
        }
    }
}

impl WriteLock {
    pub(crate) async fn release(self) {
        let closed = match self {
            Self::Sqlite(it) => it.close().await,
            Self::Postgres(it) => it.close().await,
        };
        closed.expect("unlocks");
    }
}
