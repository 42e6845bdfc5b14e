//! The schema, brought up to date step by step.

use super::failures::During;
use crate::StoreError;
use crate::db::schema::{self, FoundSchema, START, State, Steps, step};
use sqlx::migrate::Migration;
use sqlx::{Executor, Row, SqlitePool};

/// The steps of the schema. Each has its counterpart in PostgreSQL's.
///
/// SQLite can't alter a CHECK or a reference. A step that makes such a table anew, in the order of
/// <https://sqlite.org/lang_altertable.html#otheralter>, switches foreign keys off meanwhile. One that only allows more can
/// replace the table's text with `PRAGMA writable_schema = ON`, and makes an index anew so that all connections read the text
/// again. Both pragmas are settings of the connection, outside of transactions: such a step is a [`Migration`] with `no_tx`,
/// brings its own transaction, and changes nothing more when it is run twice.
pub(crate) fn steps() -> Steps {
    let start = include_str!("../../../../../migrations/sqlite/0039_start.sql");
    let capacity = include_str!("../../../../../migrations/sqlite/0040_capacity.sql");
    Steps {
        start: step(START, "start", start),
        later: vec![step(40, "capacity", capacity)],
        replaced: "2f77ee66c449486ed6fd1e0914b10abbc72543820a366fa414f2192be760a12e".to_owned(),
    }
}

/// Brings the schema up to date, unless the database is one that this program can't use.
///
/// # Errors
/// When the database is of another program, a newer version or one that is too early, or fails.
pub(super) async fn run(writer: &SqlitePool, steps: &Steps) -> Result<(), StoreError> {
    let action = "bringing the database's schema up to date";
    if schema::state(steps, &found(writer).await?)? == State::Replaced {
        take_over(writer, &steps.start).await.during(action)?;
    }
    let mut applied = found(writer).await?.applied.len();
    loop {
        let done = steps.migrator().run(writer).await;
        let Err(error) = done else { return Ok(()) };
        // Steps have no lock. If another process has done one meanwhile, the rest is tried again.
        let now = found(writer).await?.applied.len();
        if now <= applied {
            return Err(sqlx::Error::from(error)).during(action);
        }
        applied = now;
    }
}

/// Replaces the records of the steps before the start. Another process may have done so meanwhile.
async fn take_over(writer: &SqlitePool, start: &Migration) -> Result<(), sqlx::Error> {
    let mut tx = writer.begin_with("BEGIN IMMEDIATE").await?;
    let forgotten = sqlx::query(schema::FORGET).bind(start.version);
    forgotten.execute(&mut *tx).await?;
    let recorded = sqlx::query(schema::RECORD)
        .bind(start.version)
        .bind(&*start.description)
        .bind(&*start.checksum);
    recorded.execute(&mut *tx).await?;
    tx.commit().await
}

/// Whether the schema has to be brought up to date.
///
/// # Errors
/// As [`run`].
pub(super) async fn are_pending(readers: &SqlitePool) -> Result<bool, StoreError> {
    schema::are_pending(&steps(), &found(readers).await?)
}

/// What the database contains.
async fn found(writer: &SqlitePool) -> Result<FoundSchema, StoreError> {
    let action = "reading the database's schema";
    let tables = "SELECT name FROM sqlite_schema WHERE type = 'table' AND name NOT LIKE 'sqlite\\_%' ESCAPE '\\' ORDER BY 1";
    let rows = writer.fetch_all(tables).await.during(action)?;
    let tables: Result<Vec<String>, _> = rows.iter().map(|row| row.try_get("name")).collect();
    let tables = tables.during(action)?;
    let mut applied = Vec::new();
    if tables.iter().any(|it| it == schema::APPLIED) {
        let statement = "SELECT version, checksum FROM _sqlx_migrations ORDER BY version";
        for row in writer.fetch_all(statement).await.during(action)? {
            let version = row.try_get("version").during(action)?;
            applied.push((version, row.try_get("checksum").during(action)?));
        }
    }
    Ok(FoundSchema { tables, applied })
}
