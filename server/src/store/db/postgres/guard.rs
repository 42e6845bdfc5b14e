//! One coordinator per database: a lock of the database, held by a connection of its own.
//!
//! Each coordinator has its own folder of objects, so a second one on the same database would look for objects where they
//! are not.

use super::failures::During;
use crate::store::StoreError;
use sqlx::postgres::{PgConnectOptions, PgConnection};
use sqlx::{ConnectOptions, Connection, Row};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tokio::sync::Mutex;
use tokio::time::{Instant, sleep};

/// The first number of this program's advisory locks, "yoto" in ASCII: other programs may have locks in the same database.
pub const PROGRAM: i32 = 0x796f_746f;
/// The second number of the coordinator's lock. Locks of transactions have others.
const COORDINATOR: i32 = 0;
/// How long a new coordinator waits for the lock: the database needs a moment to notice that a killed one is gone.
const PATIENCE: Duration = Duration::from_secs(3);
/// Interval between two attempts.
const RETRY: Duration = Duration::from_millis(100);

/// The lock. The database frees it when the connection ends.
#[derive(Debug)]
pub struct Guard {
    options: PgConnectOptions,
    connection: Mutex<Option<PgConnection>>,
    /// Whether no other coordinator had it at the last check.
    held: AtomicBool,
}

impl Guard {
    /// Takes the lock.
    ///
    /// # Errors
    /// When another coordinator has it, or the database can't be reached.
    pub async fn take(options: PgConnectOptions) -> Result<Self, StoreError> {
        let until = Instant::now() + PATIENCE;
        let mut connection = connect(&options).await?;
        while !locked(&mut connection).await? {
            if Instant::now() >= until {
                return Err(StoreError::Unusable(
                    "is in use by another coordinator; stop it, or name another database"
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

    /// Takes the lock again if its connection was lost.
    ///
    /// # Errors
    /// When another coordinator has taken it meanwhile, or the database can't be reached.
    pub async fn renew(&self) -> Result<(), StoreError> {
        let mut held = self.connection.lock().await;
        if let Some(connection) = &mut *held
            && connection.ping().await.is_ok()
        {
            return Ok(());
        }
        *held = None;
        let mut connection = connect(&self.options).await?;
        let locked = locked(&mut connection).await?;
        self.held.store(locked, Ordering::Relaxed);
        if locked {
            *held = Some(connection);
        }
        self.check()
    }

    /// Refuses if another coordinator had the lock at the last check.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`].
    pub fn check(&self) -> Result<(), StoreError> {
        match self.held.load(Ordering::Relaxed) {
            true => Ok(()),
            false => Err(StoreError::Unavailable {
                action: "looking for other coordinators",
                cause: "another coordinator has taken the database".into(),
                rolled_back: false,
            }),
        }
    }

    /// Frees the lock.
    pub async fn release(&self) {
        if let Some(connection) = self.connection.lock().await.take()
            && let Err(error) = connection.close().await
        {
            tracing::warn!(%error, "the connection that holds the database's lock did not close");
        }
    }
}

async fn connect(options: &PgConnectOptions) -> Result<PgConnection, StoreError> {
    options.connect().await.during("connecting to the database")
}

/// Whether the connection has the coordinator's lock now.
async fn locked(connection: &mut PgConnection) -> Result<bool, StoreError> {
    let action = "locking the database";
    let row = sqlx::query("SELECT pg_try_advisory_lock($1, $2) AS mine")
        .bind(PROGRAM)
        .bind(COORDINATOR)
        .fetch_one(connection)
        .await
        .during(action)?;
    row.try_get("mine").during(action)
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_test_postgres::{Database, is_there};

    fn options(database: &Database) -> PgConnectOptions {
        database.url().parse().expect("an address")
    }

    #[tokio::test]
    async fn a_second_coordinator_is_refused_until_the_first_has_ended() {
        if !is_there() {
            return;
        }
        let database = Database::create().expect("PostgreSQL");
        let first = Guard::take(options(&database)).await.expect("it is free");
        let second = Guard::take(options(&database)).await;
        let second = second.expect_err("it is taken").to_string();
        assert!(second.contains("in use by another coordinator"), "{second}");
        first.release().await;
        Guard::take(options(&database))
            .await
            .expect("it is free again");
    }

    #[tokio::test]
    async fn a_lost_lock_is_taken_again_unless_another_coordinator_was_faster() {
        if !is_there() {
            return;
        }
        let database = Database::create().expect("PostgreSQL");
        let first = Guard::take(options(&database)).await.expect("it is free");
        database.cut();
        first.renew().await.expect("nobody has taken it");
        let second = Guard::take(options(&database)).await;
        second.expect_err("the first one has it again");

        database.cut();
        let second = Guard::take(options(&database)).await.expect("it is free");
        first.renew().await.expect_err("the second one has it");
        first.check().expect_err("it must not write");
        second.release().await;
        first.renew().await.expect("it is free again");
        first.check().expect("it may write");
    }
}
