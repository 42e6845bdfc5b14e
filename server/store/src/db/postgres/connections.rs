//! Connections to the database.

use super::advice::refusal;
use super::answer::ping;
use super::failures::During;
use super::lost::LastLoss;
use crate::StoreError;
use crate::db::PostgresUrl;
use sqlx::postgres::{PgConnectOptions, PgPoolOptions};
use sqlx::{ConnectOptions, PgPool};
use std::time::Duration;

/// Number of connections of one coordinator, beside one that listens and one that holds its lock. PostgreSQL's default is room
/// for 100 in all.
const CONNECTIONS: u32 = 20;
/// Idle time after which a connection is tested before it is used. A test of each use would cost as much as its statement.
const IDLE: Duration = Duration::from_secs(1);
/// Longest wait for a free connection.
const ACQUIRE_TIMEOUT: Duration = Duration::from_secs(10);

/// Settings of each connection (<https://www.postgresql.org/docs/current/runtime-config-client.html>).
const SETTINGS: [(&str, &str); 9] = [
    // As long as a writer waits on SQLite.
    ("lock_timeout", "10s"),
    // A coordinator that hangs, or whose machine is gone, does not keep its locks.
    ("idle_in_transaction_session_timeout", "60s"),
    // Compiling the statement that searches the queue takes longer than running it.
    ("jit", "off"),
    // The machine of a coordinator that vanishes is noticed within a minute, and its locks are free.
    ("tcp_keepalives_idle", "30"),
    ("tcp_keepalives_interval", "10"),
    ("tcp_keepalives_count", "3"),
    ("client_min_messages", "warning"),
    // For statements without a transaction, whatever the user's defaults are.
    ("default_transaction_isolation", "read committed"),
    ("default_transaction_read_only", "off"),
];

/// How `url` is connected to.
///
/// # Errors
/// When a part of the URL is unknown.
pub(super) fn options(url: &PostgresUrl) -> Result<PgConnectOptions, StoreError> {
    let options: Result<PgConnectOptions, sqlx::Error> = url.secret().parse();
    let options = options.during("reading the URL of the database")?;
    Ok(options.application_name("yoto").options(SETTINGS))
}

/// Connections for all statements. Each that was idle is tested before it is used, and any after a loss of another, so that few calls fail
/// after a restart of the database. One that does not answer for `patience` after its use is closed: the pool itself would wait for it.
///
/// # Errors
/// When the database can't be reached, or refuses the user.
pub(super) async fn pool(
    options: PgConnectOptions,
    patience: Duration,
    losses: LastLoss,
) -> Result<PgPool, StoreError> {
    let released = losses.clone();
    let pool = PgPoolOptions::new()
        .max_connections(CONNECTIONS)
        .acquire_timeout(ACQUIRE_TIMEOUT)
        .test_before_acquire(false)
        .before_acquire(move |connection, last_use| {
            let wary = last_use.idle_for >= IDLE || losses.is_recent();
            let losses = losses.clone();
            Box::pin(async move {
                if wary {
                    losses.noted(ping(patience, connection).await)?;
                }
                Ok(true)
            })
        })
        .after_release(move |connection, _| {
            let losses = released.clone();
            Box::pin(async move {
                let answer = losses.noted(ping(patience, connection).await);
                answer.map(|()| true)
            })
        })
        .connect_with(options.clone())
        .await;
    let error = match pool {
        Ok(pool) => return Ok(pool),
        // The pool tries again for that long, and does not tell why.
        Err(sqlx::Error::PoolTimedOut) => match options.connect().await {
            Ok(_) => sqlx::Error::PoolTimedOut,
            Err(error) => error,
        },
        Err(error) => error,
    };
    Err(refusal(error, &options))
}

/// One connection like those of `pool`, for a listener. What it leaves behind when it is dropped does not concern the others.
///
/// # Errors
/// When the database can't be reached.
pub(super) async fn single(pool: &PgPool) -> Result<PgPool, sqlx::Error> {
    let options = pool.connect_options().as_ref().clone();
    PgPoolOptions::new()
        .max_connections(1)
        .acquire_timeout(ACQUIRE_TIMEOUT)
        .connect_with(options)
        .await
}
