//! The schema, brought up to date step by step.

use super::advice::refusal;
use super::failures::During;
use crate::StoreError;
use crate::db::schema::{self, FoundSchema, START, State, Steps, step};
use sqlx::migrate::Migration;
use sqlx::{Executor, PgPool, Row};

/// The steps of the schema. Each has its counterpart in SQLite's.
pub(super) fn steps() -> Steps {
    let start = include_str!("../../../../../migrations/postgres/0039_start.sql");
    let capacity = include_str!("../../../../../migrations/postgres/0040_capacity.sql");
    Steps {
        start: step(START, "start", start),
        later: vec![step(40, "capacity", capacity)],
        replaced: "efb18b53a83bb969dd1676eadbe1d09f89d5193a2b024224fc4d4c91b09f5856".to_owned(),
    }
}

/// Brings the schema up to date, unless the database is one that this program can't use.
///
/// # Errors
/// When the database is of another program, a newer version or one that is too early, or fails.
pub(super) async fn run(pool: &PgPool, steps: &Steps) -> Result<(), StoreError> {
    if schema::state(steps, &found(pool).await?)? == State::Replaced {
        let done = take_over(pool, &steps.start).await;
        done.map_err(|error| refusal(error, &pool.connect_options()))?;
    }
    let done = steps.migrator().run(pool).await.map_err(sqlx::Error::from);
    done.map_err(|error| refusal(error, &pool.connect_options()))
}

/// Replaces the records of the steps before the start.
async fn take_over(pool: &PgPool, start: &Migration) -> Result<(), sqlx::Error> {
    let mut tx = pool.begin().await?;
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
pub(super) async fn are_pending(pool: &PgPool, steps: &Steps) -> Result<bool, StoreError> {
    schema::are_pending(steps, &found(pool).await?)
}

/// Refuses a schema that a newer version has changed.
///
/// # Errors
/// As [`run`].
pub(super) async fn are_known(pool: &PgPool) -> Result<(), StoreError> {
    schema::state(&steps(), &found(pool).await?).map(drop)
}

/// What the database contains.
async fn found(pool: &PgPool) -> Result<FoundSchema, StoreError> {
    let action = "reading the database's schema";
    let row = pool
        .fetch_one("SELECT pg_encoding_to_char(encoding)::text AS encoding FROM pg_database WHERE datname = current_database()")
        .await
        .during(action)?;
    let encoding: String = row.try_get("encoding").during(action)?;
    if encoding != "UTF8" {
        return Err(StoreError::Unusable(format!(
            "has the encoding {encoding}; create one with `createdb --encoding=UTF8 --template=template0`"
        )));
    }
    let tables = "SELECT tablename::text AS name FROM pg_tables WHERE schemaname = current_schema() ORDER BY 1";
    let rows = pool.fetch_all(tables).await.during(action)?;
    let tables: Result<Vec<String>, _> = rows.iter().map(|row| row.try_get("name")).collect();
    let tables = tables.during(action)?;
    let mut applied = Vec::new();
    if tables.iter().any(|it| it == schema::APPLIED) {
        let statement = "SELECT version, checksum FROM _sqlx_migrations ORDER BY version";
        for row in pool.fetch_all(statement).await.during(action)? {
            let version = row.try_get("version").during(action)?;
            applied.push((version, row.try_get("checksum").during(action)?));
        }
    }
    Ok(FoundSchema { tables, applied })
}
