//! Which coordinators may use a database at the same time: those of this version, and none while the schema changes.
//!
//! Each coordinator holds an advisory lock of the database on a connection of its own, shared with the others. One that brings
//! the schema up to date holds it alone, and so did every coordinator of versions that knew no others.

use super::answer::{self, within};
use super::failures::During;
use crate::StoreError;
use sqlx::postgres::{PgConnectOptions, PgConnection};
use sqlx::{ConnectOptions, Connection, Row};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tokio::sync::Mutex;
use tokio::time::{Instant, sleep};

/// The first number of this program's advisory locks, "yoto" in ASCII: other programs may have locks in the same database.
pub(super) const PROGRAM: i32 = 0x796f_746f;
/// The second number of the coordinators' lock. Locks of transactions have others.
const COORDINATOR: i32 = 0;
/// How long a new coordinator waits for the lock: the database needs a moment to notice that a killed one is gone.
const TAKING: Duration = Duration::from_secs(3);
/// Interval between two attempts.
const RETRY: Duration = Duration::from_millis(100);

/// The lock. The database frees it when the connection ends.
#[derive(Debug)]
pub(super) struct Guard {
    options: PgConnectOptions,
    connection: Mutex<Option<PgConnection>>,
    /// Whether no coordinator had it alone at the last check.
    held: AtomicBool,
}

impl Guard {
    /// Takes the lock. `upgrade` is run under the lock alone as long as `is_pending` says that it is needed.
    ///
    /// # Errors
    /// When a coordinator of another version uses the database, or it can't be reached; an error of the two.
    pub(super) async fn take(
        options: PgConnectOptions,
        is_pending: impl AsyncFn() -> Result<bool, StoreError>,
        upgrade: impl AsyncFn() -> Result<(), StoreError>,
    ) -> Result<Self, StoreError> {
        let mut until = Instant::now() + TAKING;
        let mut connection = connect(&options).await?;
        loop {
            // Without the lock: those that wait to have it alone would keep it from each other.
            if is_pending().await? {
                if ask(&mut connection, ALONE).await? {
                    ask(&mut connection, CHANGE).await?;
                    upgrade().await?;
                    ask(&mut connection, SHARE).await?;
                    ask(&mut connection, LEAVE).await?;
                    ask(&mut connection, END_CHANGE).await?;
                    break;
                }
            } else if ask(&mut connection, SHARE).await? {
                if !is_pending().await? {
                    break;
                }
                ask(&mut connection, UNSHARE).await?;
            }
            // However long that takes.
            if ask(&mut connection, IS_CHANGING).await? {
                until = Instant::now() + TAKING;
            }
            if Instant::now() >= until {
                return Err(StoreError::Unusable(
                    "is in use by a coordinator of another version; stop it, or name another database"
                        .to_owned(),
                ));
            }
            sleep(RETRY).await;
        }
        Ok(Self {
            options,
            connection: Mutex::new(Some(connection)),
            held: AtomicBool::new(true),
        })
    }

    /// Takes the lock again if its connection was lost. `is_known` tells whether the schema is still one of this version:
    /// while nobody had the lock, another one may have changed it.
    ///
    /// # Errors
    /// When a coordinator of another version has taken it meanwhile, or the database can't be reached; an error of
    /// `is_known`.
    pub(super) async fn renew(
        &self,
        is_known: impl Future<Output = Result<(), StoreError>>,
    ) -> Result<(), StoreError> {
        let mut held = self.connection.lock().await;
        if let Some(connection) = &mut *held
            && answer::ping(answer::PATIENCE, connection).await.is_ok()
        {
            return Ok(());
        }
        *held = None;
        let mut connection = connect(&self.options).await?;
        let locked = ask(&mut connection, SHARE).await?;
        let known = if locked { is_known.await } else { Ok(()) };
        let newer = matches!(known, Err(StoreError::Unusable(_)));
        self.held.store(locked && !newer, Ordering::Relaxed);
        known?;
        if locked {
            *held = Some(connection);
        }
        self.check()
    }

    /// Refuses if a coordinator of another version had the lock at the last check.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`].
    pub(super) fn check(&self) -> Result<(), StoreError> {
        match self.held.load(Ordering::Relaxed) {
            true => Ok(()),
            false => Err(StoreError::Unavailable {
                action: "looking for other coordinators",
                cause: "a coordinator of another version has taken the database".into(),
                rolled_back: false,
            }),
        }
    }

    /// Frees the lock.
    pub(super) async fn release(&self) {
        if let Some(connection) = self.connection.lock().await.take()
            && let Err(error) = within(answer::PATIENCE, connection.close()).await
        {
            tracing::warn!(%error, "the connection that holds the database's lock did not close");
        }
    }
}

async fn connect(options: &PgConnectOptions) -> Result<PgConnection, StoreError> {
    within(answer::PATIENCE, options.connect())
        .await
        .during("connecting to the database")
}

/// Takes the lock beside others, unless one has it alone.
const SHARE: &str = "SELECT pg_try_advisory_lock_shared($1, $2) AS done";
/// Frees it.
const UNSHARE: &str = "SELECT pg_advisory_unlock_shared($1, $2) AS done";
/// Takes the lock alone, unless another connection has it.
const ALONE: &str = "SELECT pg_try_advisory_lock($1, $2) AS done";
/// Frees it.
const LEAVE: &str = "SELECT pg_advisory_unlock($1, $2) AS done";

/// Tells others that the schema is being changed, by a lock of its own.
const CHANGE: &str = "SELECT pg_try_advisory_lock($1, $2 + 4) AS done";
/// Frees it.
const END_CHANGE: &str = "SELECT pg_advisory_unlock($1, $2 + 4) AS done";
/// Whether a coordinator changes the schema.
const IS_CHANGING: &str =
    "SELECT EXISTS (SELECT 1 FROM pg_locks WHERE locktype = 'advisory' AND granted
    AND database = (SELECT oid FROM pg_database WHERE datname = current_database())
    AND classid = $1::int4::oid AND objid = ($2::int4 + 4)::oid) AS done";

/// Whether the database did what `statement` asks for.
async fn ask(connection: &mut PgConnection, statement: &'static str) -> Result<bool, StoreError> {
    let action = "locking the database";
    let row = sqlx::query(statement)
        .bind(PROGRAM)
        .bind(COORDINATOR)
        .fetch_one(connection);
    let row = within(answer::PATIENCE, row).await.during(action)?;
    row.try_get("done").during(action)
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_test_postgres::{Database, is_there};

    fn options(database: &Database) -> PgConnectOptions {
        database.url().parse().expect("an address")
    }

    /// A coordinator for which the schema is up to date.
    async fn beside(database: &Database) -> Result<Guard, StoreError> {
        let never = async || panic!("it is up to date");
        Guard::take(options(database), async || Ok(false), never).await
    }

    /// A coordinator that knows no others, as soon as the database has noticed that others are gone.
    async fn alone(database: &Database) -> PgConnection {
        let mut connection = connect(&options(database)).await.expect("connects");
        while !ask(&mut connection, ALONE).await.expect("answers") {
            sleep(RETRY).await;
        }
        connection
    }

    #[tokio::test]
    async fn coordinators_share_a_database_but_not_with_one_that_knows_no_others() {
        if !is_there() {
            return;
        }
        let database = Database::create().expect("PostgreSQL");
        let first = beside(&database).await.expect("it is free");
        let second = beside(&database).await.expect("they share it");
        let mut old = connect(&options(&database)).await.expect("connects");
        assert!(
            !ask(&mut old, ALONE).await.expect("answers"),
            "both have it"
        );
        first.release().await;
        second.release().await;
        let _old = alone(&database).await;
        let refused = beside(&database).await.expect_err("it is taken");
        let refused = refused.to_string();
        assert!(refused.contains("of another version"), "{refused}");
    }

    #[tokio::test]
    async fn the_schema_changes_while_nobody_else_uses_the_database() {
        if !is_there() {
            return;
        }
        let database = Database::create().expect("PostgreSQL");
        let done = AtomicBool::new(false);
        let upgrade = async || {
            let mut other = connect(&options(&database)).await?;
            assert!(!ask(&mut other, SHARE).await?, "it is alone");
            // Longer than the other one is patient.
            sleep(TAKING + RETRY).await;
            done.store(true, Ordering::Relaxed);
            Ok(())
        };
        let pending = async || Ok(!done.load(Ordering::Relaxed));
        let first = beside(&database).await.expect("it is free");
        let refused = Guard::take(options(&database), pending, upgrade).await;
        let refused = refused.expect_err("another one runs").to_string();
        assert!(refused.contains("of another version"), "{refused}");
        first.release().await;
        let both = tokio::join!(
            Guard::take(options(&database), pending, upgrade),
            Guard::take(options(&database), pending, upgrade),
        );
        both.0.expect("is up to date");
        both.1.expect("is up to date");
    }

    #[tokio::test]
    async fn a_lost_lock_is_taken_again_unless_another_version_was_faster() {
        if !is_there() {
            return;
        }
        let database = Database::create().expect("PostgreSQL");
        let ours = async || Ok(());
        let first = beside(&database).await.expect("it is free");
        database.cut();
        first.renew(ours()).await.expect("nobody has taken it");

        database.cut();
        let mut other = alone(&database).await;
        first.renew(ours()).await.expect_err("the other one has it");
        first.check().expect_err("it must not write");
        assert!(ask(&mut other, LEAVE).await.expect("answers"));
        first.renew(ours()).await.expect("it is free again");
        first.check().expect("it may write");

        database.cut();
        let newer = async || Err(StoreError::Unusable("has schema 99".to_owned()));
        first.renew(newer()).await.expect_err("it is changed");
        first.check().expect_err("it must not write");
    }
}
