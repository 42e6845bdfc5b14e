//! The database behind the service's back.

use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{ConnectOptions, SqliteConnection};

/// Changes the database behind the service's back.
pub async fn sql(database: &std::path::Path, statement: &str) {
    let options = SqliteConnectOptions::new().filename(database);
    let mut connection = options.connect().await.expect("opens");
    let statement = sqlx::AssertSqlSafe(statement.to_owned());
    let done = sqlx::query(statement).execute(&mut connection).await;
    assert!(
        done.expect("runs").rows_affected() > 0,
        "it changes nothing"
    );
}

/// Locks the database for writes, as another program on the machine can, until the connection is closed.
pub async fn lock_writes(database: &std::path::Path) -> SqliteConnection {
    let options = SqliteConnectOptions::new().filename(database);
    let mut connection = options.connect().await.expect("opens");
    let locked = sqlx::query("BEGIN IMMEDIATE").execute(&mut connection);
    locked.await.expect("locks");
    connection
}
