//! Connections to the database: one that writes, and some that read.
//!
//! A connection with an open transaction is closed when it returns to its pool. When the disk is full, SQLite rolls a
//! transaction back by itself, but the driver counts it as open and refuses all later transactions on that connection.

use super::failures::During;
use crate::StoreError;
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteConnection, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous,
};
use sqlx::{Connection, SqlitePool};
use std::io::ErrorKind;
use std::path::Path;
use std::time::Duration;
use yoto_process::private;

/// Longest wait of a statement for a lock.
const BUSY_TIMEOUT: Duration = Duration::from_secs(10);
/// Size to which the journal is cut after a checkpoint, bytes: it would keep its largest size.
const JOURNAL_BYTES: &str = "67108864";
/// Number of read-only connections.
const READERS: u32 = 4;

fn options(path: &Path) -> SqliteConnectOptions {
    SqliteConnectOptions::new()
        .filename(path)
        .foreign_keys(true)
        .busy_timeout(BUSY_TIMEOUT)
        .synchronous(SqliteSynchronous::Full)
        .pragma("journal_size_limit", JOURNAL_BYTES)
}

/// The connection for writes to the file at `path`, which is created if missing.
///
/// # Errors
/// When the file can't be opened.
pub(super) async fn writer(path: &Path) -> Result<SqlitePool, StoreError> {
    // SQLite gives its journal files the mode of the database. An existing file is not opened: closing it would release
    // the locks of other connections of this process.
    match private::writable().create_new(true).open(path) {
        Err(error) if error.kind() != ErrorKind::AlreadyExists => {
            return Err(sqlx::Error::Io(error)).during("creating the database");
        }
        _ => {}
    }
    let writable = options(path).journal_mode(SqliteJournalMode::Wal);
    pool(1)
        .connect_with(writable)
        .await
        .during("opening the database for writing")
}

/// Connections for reads of an existing file.
///
/// # Errors
/// When the file can't be opened.
pub(super) async fn readers(path: &Path) -> Result<SqlitePool, StoreError> {
    pool(READERS)
        .connect_with(options(path).read_only(true))
        .await
        .during("opening the database for reading")
}

fn pool(connections: u32) -> SqlitePoolOptions {
    SqlitePoolOptions::new()
        .max_connections(connections)
        .after_release(|connection, _| Box::pin(is_usable(connection)))
}

/// Whether a connection that returns to its pool has no open transaction.
async fn is_usable(connection: &mut SqliteConnection) -> Result<bool, sqlx::Error> {
    // The ping is answered after any rollback that is still queued for the connection's thread.
    connection.ping().await?;
    let usable = !connection.is_in_transaction();
    if !usable {
        tracing::warn!("a transaction could not be rolled back: its connection is closed");
    }
    Ok(usable)
}

#[cfg(test)]
mod tests {
    use crate::{NewSubject, Store, Tenant};
    use std::sync::Arc;
    use yoto_process::clock::SystemClock;

    fn person(consent_note: String) -> NewSubject {
        NewSubject {
            display_name: "Ada".to_owned(),
            consent_note,
        }
    }

    #[tokio::test]
    async fn a_write_without_room_leaves_a_writer_that_works() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("yoto.db");
        let opened = Store::open_sqlite(&path, Arc::new(SystemClock)).await;
        let store = opened.expect("opens");
        // With this limit of the connection, SQLite fails as on a full disk.
        let mut connection = store
            .db
            .sqlite()
            .writer
            .acquire()
            .await
            .expect("the writer");
        sqlx::query("PRAGMA max_page_count = 1")
            .execute(&mut *connection)
            .await
            .expect("a limit");
        drop(connection);
        let note = "x".repeat(1 << 20);
        let full = store
            .create_subject(&Tenant::default(), person(note), None)
            .await;
        let full = full.expect_err("there is no room");
        let created = store
            .create_subject(&Tenant::default(), person(String::new()), None)
            .await;
        let created = created.unwrap_or_else(|error| panic!("after '{full}': {error}"));
        assert_eq!(created.display_name, "Ada");
        store.keep_time().await.expect("writes work");
    }
}
