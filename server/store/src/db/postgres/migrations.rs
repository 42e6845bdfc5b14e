//! The schema, brought up to date step by step.

use super::advice::refusal;
use super::failures::During;
use crate::StoreError;
use crate::db::schema::{self, Found};
use sqlx::migrate::{Migration, MigrationType, Migrator};
use sqlx::{Executor, PgPool, Row, SqlSafeStr};

/// The schema, step by step. The first step makes all that SQLite's steps up to the same number make; from there on, each
/// step has its counterpart there.
pub fn migrations() -> Migrator {
    let init = include_str!("../../../../../migrations/postgres/0021_init.sql").into_sql_str();
    let shared =
        include_str!("../../../../../migrations/postgres/0022_shared_state.sql").into_sql_str();
    let parts =
        include_str!("../../../../../migrations/postgres/0023_upload_parts.sql").into_sql_str();
    let operators =
        include_str!("../../../../../migrations/postgres/0024_operators.sql").into_sql_str();
    let several = include_str!("../../../../../migrations/postgres/0025_several_coordinators.sql")
        .into_sql_str();
    let keys = include_str!("../../../../../migrations/postgres/0026_keys.sql").into_sql_str();
    let consents =
        include_str!("../../../../../migrations/postgres/0027_consents.sql").into_sql_str();
    let traces = include_str!("../../../../../migrations/postgres/0028_traces.sql").into_sql_str();
    let quotas = include_str!("../../../../../migrations/postgres/0029_quotas.sql").into_sql_str();
    let audit = include_str!("../../../../../migrations/postgres/0030_audit.sql").into_sql_str();
    let shares = include_str!("../../../../../migrations/postgres/0031_shares.sql").into_sql_str();
    let films = include_str!("../../../../../migrations/postgres/0032_films.sql").into_sql_str();
    let webhooks =
        include_str!("../../../../../migrations/postgres/0033_webhooks.sql").into_sql_str();
    let rates = include_str!("../../../../../migrations/postgres/0034_rates.sql").into_sql_str();
    let retraining =
        include_str!("../../../../../migrations/postgres/0035_retraining.sql").into_sql_str();
    let aliases =
        include_str!("../../../../../migrations/postgres/0036_aliases.sql").into_sql_str();
    let evidence =
        include_str!("../../../../../migrations/postgres/0037_evidence.sql").into_sql_str();
    let sessions =
        include_str!("../../../../../migrations/postgres/0038_sessions.sql").into_sql_str();
    let step = |version, name: &'static str, sql| {
        Migration::new(version, name.into(), MigrationType::Simple, sql, false)
    };
    Migrator::with_migrations(vec![
        step(21, "init", init),
        step(22, "shared state", shared),
        step(23, "upload parts", parts),
        step(24, "operators", operators),
        step(25, "several coordinators", several),
        step(26, "keys", keys),
        step(27, "consents", consents),
        step(28, "traces", traces),
        step(29, "quotas", quotas),
        step(30, "audit", audit),
        step(31, "shares", shares),
        step(32, "films", films),
        step(33, "webhooks", webhooks),
        step(34, "rates", rates),
        step(35, "retraining", retraining),
        step(36, "aliases", aliases),
        step(37, "evidence", evidence),
        step(38, "sessions", sessions),
    ])
}

/// Brings the schema up to date, unless the database is one that this program can't use.
///
/// # Errors
/// When the database is of another program or a newer version, or fails.
pub async fn run(pool: &PgPool) -> Result<(), StoreError> {
    let migrations = migrations();
    schema::check(&migrations, &found(pool).await?)?;
    let done = migrations.run(pool).await.map_err(sqlx::Error::from);
    done.map_err(|error| refusal(error, &pool.connect_options()))
}

/// Whether the schema has to be brought up to date.
///
/// # Errors
/// As [`run`].
pub async fn are_pending(pool: &PgPool) -> Result<bool, StoreError> {
    schema::are_pending(&migrations(), &found(pool).await?)
}

/// Refuses a schema that a newer version has changed.
///
/// # Errors
/// As [`run`].
pub async fn are_known(pool: &PgPool) -> Result<(), StoreError> {
    schema::check(&migrations(), &found(pool).await?)
}

/// What the database contains.
async fn found(pool: &PgPool) -> Result<Found, StoreError> {
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
    Ok(Found { tables, applied })
}
