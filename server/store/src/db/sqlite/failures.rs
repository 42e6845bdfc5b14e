//! Classifies errors of the SQLite driver by what a caller can do about them.

use crate::StoreError;

/// Adds the action to errors of the driver.
pub(super) trait During<T> {
    /// Adds `action`, e.g. "reading a job", and classifies the failure.
    fn during(self, action: &'static str) -> Result<T, StoreError>;
}

impl<T> During<T> for Result<T, sqlx::Error> {
    fn during(self, action: &'static str) -> Result<T, StoreError> {
        self.map_err(|error| of_driver(action, error))
    }
}

/// Result codes of failures that end without a repair, or once there is room on the disk
/// (<https://sqlite.org/rescode.html>): BUSY, LOCKED, NOMEM, READONLY, IOERR, FULL, CANTOPEN, PROTOCOL. An exceeded
/// disk quota is reported as IOERR.
const PASSING: [i32; 8] = [5, 6, 7, 8, 10, 13, 14, 15];
/// Result code of a violated constraint: another call changed the rows first.
const CONSTRAINT: i32 = 19;
/// Mask of the primary result code; the bits above it are the extended code.
const KIND: i32 = 0xff;

/// The store's error for an error of the driver during `action`.
fn of_driver(action: &'static str, error: sqlx::Error) -> StoreError {
    let passing = matches!(
        error,
        sqlx::Error::PoolTimedOut | sqlx::Error::WorkerCrashed | sqlx::Error::Io(_)
    );
    let kind = kind(&error);
    let cause = Box::new(error);
    match kind {
        _ if passing => unavailable(action, cause),
        Some(kind) if PASSING.contains(&kind) => unavailable(action, cause),
        Some(CONSTRAINT) => StoreError::Conflict { action, cause },
        _ => StoreError::Database { action, cause },
    }
}

/// SQLite has one writer, so it never rolls a transaction back for the sake of another one.
fn unavailable(action: &'static str, cause: Box<sqlx::Error>) -> StoreError {
    StoreError::Unavailable {
        action,
        cause,
        rolled_back: false,
    }
}

/// The primary result code, if the error comes from SQLite.
fn kind(error: &sqlx::Error) -> Option<i32> {
    let code = error.as_database_error()?.code()?;
    Some(code.parse::<i32>().ok()? & KIND)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sqlx::sqlite::SqliteConnectOptions;
    use sqlx::{ConnectOptions, Executor};
    use std::time::Duration;

    /// The error of the first of `statements` that fails.
    async fn failure(statements: &[&'static str]) -> StoreError {
        let dir = tempfile::tempdir().expect("a folder");
        let options = SqliteConnectOptions::new()
            .filename(dir.path().join("a.db"))
            .create_if_missing(true)
            .busy_timeout(Duration::ZERO);
        let mut other = options.connect().await.expect("opens");
        other
            .execute("CREATE TABLE t (a INTEGER UNIQUE)")
            .await
            .expect("a table");
        if statements == ["BEGIN IMMEDIATE"] {
            other.execute("BEGIN IMMEDIATE").await.expect("locks");
        }
        let mut connection = options.connect().await.expect("opens");
        for statement in statements {
            if let Err(error) = connection.execute(*statement).await {
                return of_driver("testing", error);
            }
        }
        panic!("{statements:?} did not fail")
    }

    #[tokio::test]
    async fn errors_are_classified_by_what_a_caller_can_do() {
        let locked = failure(&["BEGIN IMMEDIATE"]).await;
        assert!(matches!(locked, StoreError::Unavailable { .. }), "{locked}");
        let full = failure(&[
            "PRAGMA max_page_count = 1",
            "CREATE TABLE u AS SELECT zeroblob(100000) AS b",
        ])
        .await;
        assert!(matches!(full, StoreError::Unavailable { .. }), "{full}");
        let read_only = failure(&["PRAGMA query_only = 1", "INSERT INTO t VALUES (1)"]).await;
        assert!(
            matches!(read_only, StoreError::Unavailable { .. }),
            "{read_only}"
        );
        let twice = failure(&["INSERT INTO t VALUES (1)", "INSERT INTO t VALUES (1)"]).await;
        assert!(matches!(twice, StoreError::Conflict { .. }), "{twice}");
        let broken = failure(&["SELECT a FROM nothing"]).await;
        assert!(matches!(broken, StoreError::Database { .. }), "{broken}");
        let late = of_driver("testing", sqlx::Error::PoolTimedOut);
        assert!(matches!(late, StoreError::Unavailable { .. }), "{late}");
    }
}
