//! Classifies errors of the PostgreSQL driver by what a caller can do about them.

use crate::StoreError;

/// Adds the action to errors of the driver.
pub(super) trait During<T> {
    /// Adds `action`, e.g. "reading a job", and classifies the failure of something that has not changed the database:
    /// a statement that reads, one inside of a transaction, which is rolled back, or one that does the same when it is run again.
    fn during(self, action: &'static str) -> Result<T, StoreError>;

    /// The same for the failure of a commit.
    fn committing(self) -> Result<T, StoreError>;
}

impl<T> During<T> for Result<T, sqlx::Error> {
    fn during(self, action: &'static str) -> Result<T, StoreError> {
        self.map_err(|error| of_driver(action, error, true))
    }

    fn committing(self) -> Result<T, StoreError> {
        // The commit may have arrived before the connection was lost. Only the caller can find out, by its request id.
        self.map_err(|error| of_driver("committing a transaction", error, false))
    }
}

/// The store's error for an error of the driver during `action`. If the connection was lost, the database was `unchanged`, or
/// that is unknown.
fn of_driver(action: &'static str, error: sqlx::Error, unchanged: bool) -> StoreError {
    let class = class(&error);
    let cause = Box::new(error);
    let rolled_back = match class {
        Class::RolledBack => true,
        Class::Lost => unchanged,
        Class::Passing => false,
        Class::Constraint => return StoreError::Conflict { action, cause },
        Class::Broken => return StoreError::Database { action, cause },
    };
    StoreError::Unavailable {
        action,
        cause,
        rolled_back,
    }
}

/// Whether the connection is lost, or leads to a database that takes no writes.
pub(super) fn is_lost(error: &sqlx::Error) -> bool {
    class(error) == Class::Lost
}

/// What has happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Class {
    /// The database has rolled the transaction back because of another one.
    RolledBack,
    /// The connection is lost, or leads to a database that takes no writes: it ends, starts, or is a standby.
    Lost,
    /// The database can't do it now: its disk is full, or a lock was not free for a long time.
    Passing,
    /// A row violates a constraint: another call changed the database first.
    Constraint,
    /// Anything else.
    Broken,
}

/// The class of an error, by its SQLSTATE (<https://www.postgresql.org/docs/current/errcodes-appendix.html>).
fn class(error: &sqlx::Error) -> Class {
    let code = error.as_database_error().and_then(|it| it.code());
    match (code.as_deref(), error) {
        // serialization_failure, deadlock_detected
        (Some("40001" | "40P01"), _) => Class::RolledBack,
        // admin_shutdown, crash_shutdown, cannot_connect_now; read_only_sql_transaction, which a standby answers;
        // idle_in_transaction_session_timeout
        (Some("57P01" | "57P02" | "57P03" | "25006" | "25P03"), _) => Class::Lost,
        // lock_not_available, query_canceled, io_error
        (Some("55P03" | "57014" | "58030"), _) => Class::Passing,
        (Some(code), _) => match code.get(..2) {
            Some("08") => Class::Lost,
            // Insufficient resources: disk, memory, connections.
            Some("53") => Class::Passing,
            Some("23") => Class::Constraint,
            _ => Class::Broken,
        },
        (None, sqlx::Error::Io(_) | sqlx::Error::Protocol(_)) => Class::Lost,
        (None, sqlx::Error::PoolTimedOut | sqlx::Error::PoolClosed) => Class::Passing,
        _ => Class::Broken,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sqlx::postgres::PgConnectOptions;
    use sqlx::{ConnectOptions, Executor, PgConnection};
    use yoto_test_postgres::{Database, is_there};

    async fn connect(database: &Database) -> PgConnection {
        let options: PgConnectOptions = database.url().parse().expect("an address");
        options.connect().await.expect("connects")
    }

    /// The error of the first of `statements` that fails.
    async fn failure(connection: &mut PgConnection, statements: &[&'static str]) -> StoreError {
        for statement in statements {
            if let Err(error) = connection.execute(*statement).await.during("testing") {
                return error;
            }
        }
        panic!("{statements:?} did not fail")
    }

    /// Whether the error may pass, and if so whether the database has rolled the transaction back.
    fn passes(error: &StoreError) -> Option<bool> {
        match error {
            StoreError::Unavailable { rolled_back, .. } => Some(*rolled_back),
            _ => None,
        }
    }

    #[tokio::test]
    async fn errors_are_classified_by_what_a_caller_can_do() {
        if !is_there() {
            return;
        }
        let database = Database::create().expect("PostgreSQL");
        database.run("CREATE TABLE t (a BIGINT UNIQUE); INSERT INTO t VALUES (1), (2)");
        let mut connection = connect(&database).await;
        let twice = failure(&mut connection, &["INSERT INTO t VALUES (1)"]).await;
        assert!(matches!(twice, StoreError::Conflict { .. }), "{twice}");
        let broken = failure(&mut connection, &["SELECT a FROM nothing"]).await;
        assert!(matches!(broken, StoreError::Database { .. }), "{broken}");

        let mut other = connect(&database).await;
        let locks = ["BEGIN", "SELECT 1 FROM t WHERE a = 1 FOR UPDATE"];
        for statement in locks {
            other.execute(statement).await.expect("locks");
        }
        let wait = ["SET lock_timeout = 1", "UPDATE t SET a = 1 WHERE a = 1"];
        let late = failure(&mut connection, &wait).await;
        assert_eq!(passes(&late), Some(false), "{late}");
        let standby = ["BEGIN READ ONLY", "DELETE FROM t"];
        let standby = failure(&mut connection, &standby).await;
        assert_eq!(passes(&standby), Some(true), "{standby}");
    }

    #[tokio::test]
    async fn one_of_two_that_wait_for_each_other_is_rolled_back() {
        if !is_there() {
            return;
        }
        let database = Database::create().expect("PostgreSQL");
        database.run("CREATE TABLE t (a BIGINT UNIQUE, b BIGINT); INSERT INTO t VALUES (1), (2)");
        let mut both = [connect(&database).await, connect(&database).await];
        for (connection, first) in both.iter_mut().zip([
            "UPDATE t SET b = 1 WHERE a = 1",
            "UPDATE t SET b = 1 WHERE a = 2",
        ]) {
            connection.execute("BEGIN").await.expect("begins");
            connection.execute(first).await.expect("locks");
        }
        let [one, two] = &mut both;
        let (one, two) = tokio::join!(
            one.execute("UPDATE t SET b = 1 WHERE a = 2; COMMIT"),
            two.execute("UPDATE t SET b = 1 WHERE a = 1; COMMIT"),
        );
        let failed: Vec<StoreError> = [one, two]
            .into_iter()
            .filter_map(|it| it.during("testing").err())
            .collect();
        assert_eq!(failed.iter().map(passes).collect::<Vec<_>>(), [Some(true)]);
    }

    #[tokio::test]
    async fn after_a_lost_connection_only_the_outcome_of_a_commit_is_unknown() {
        if !is_there() {
            return;
        }
        let database = Database::create().expect("PostgreSQL");
        let mut connection = connect(&database).await;
        connection.execute("BEGIN").await.expect("begins");
        database.cut();
        let lost = connection.execute("SELECT 1").await;
        let lost = lost.during("testing").expect_err("the connection is cut");
        assert_eq!(passes(&lost), Some(true), "{lost}");
        let commit = connection.execute("COMMIT").await.committing();
        let commit = commit.expect_err("the connection is cut");
        assert_eq!(passes(&commit), Some(false), "{commit}");
    }
}
