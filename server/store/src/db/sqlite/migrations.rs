//! The schema, brought up to date step by step.

use super::failures::During;
use crate::StoreError;
use crate::db::schema::{self, Found};
use sqlx::migrate::{Migration, MigrationType, Migrator};
use sqlx::{Executor, Row, SqlSafeStr, SqlitePool};

/// The schema, step by step.
pub fn migrations() -> Migrator {
    let init = include_str!("../../../../../migrations/sqlite/0001_init.sql").into_sql_str();
    let evaluate =
        include_str!("../../../../../migrations/sqlite/0002_evaluate_jobs.sql").into_sql_str();
    let tradeoffs =
        include_str!("../../../../../migrations/sqlite/0003_tradeoffs.sql").into_sql_str();
    let retries = include_str!("../../../../../migrations/sqlite/0004_retries.sql").into_sql_str();
    let slots =
        include_str!("../../../../../migrations/sqlite/0005_trained_slots.sql").into_sql_str();
    let frames =
        include_str!("../../../../../migrations/sqlite/0006_frame_numbers.sql").into_sql_str();
    let shards =
        include_str!("../../../../../migrations/sqlite/0007_checkpoint_shards.sql").into_sql_str();
    let storage = include_str!("../../../../../migrations/sqlite/0008_storage.sql").into_sql_str();
    let jobs = include_str!("../../../../../migrations/sqlite/0009_jobs.sql").into_sql_str();
    let uploads = include_str!("../../../../../migrations/sqlite/0010_uploads.sql").into_sql_str();
    let ranges =
        include_str!("../../../../../migrations/sqlite/0011_render_ranges.sql").into_sql_str();
    let models =
        include_str!("../../../../../migrations/sqlite/0012_scene_models.sql").into_sql_str();
    let exports =
        include_str!("../../../../../migrations/sqlite/0013_export_jobs.sql").into_sql_str();
    let clock =
        include_str!("../../../../../migrations/sqlite/0014_clock_steps.sql").into_sql_str();
    let tenants = include_str!("../../../../../migrations/sqlite/0015_tenants.sql").into_sql_str();
    let stamps = include_str!("../../../../../migrations/sqlite/0016_stamps.sql").into_sql_str();
    let metrics =
        include_str!("../../../../../migrations/sqlite/0017_job_metrics.sql").into_sql_str();
    let levels =
        include_str!("../../../../../migrations/sqlite/0018_order_levels.sql").into_sql_str();
    let files =
        include_str!("../../../../../migrations/sqlite/0019_capture_objects.sql").into_sql_str();
    let turns =
        include_str!("../../../../../migrations/sqlite/0021_turns_of_tenants.sql").into_sql_str();
    let shared =
        include_str!("../../../../../migrations/sqlite/0022_shared_state.sql").into_sql_str();
    let parts =
        include_str!("../../../../../migrations/sqlite/0023_upload_parts.sql").into_sql_str();
    let operators =
        include_str!("../../../../../migrations/sqlite/0024_operators.sql").into_sql_str();
    let several = include_str!("../../../../../migrations/sqlite/0025_several_coordinators.sql")
        .into_sql_str();
    let keys = include_str!("../../../../../migrations/sqlite/0026_keys.sql").into_sql_str();
    let consents =
        include_str!("../../../../../migrations/sqlite/0027_consents.sql").into_sql_str();
    let traces = include_str!("../../../../../migrations/sqlite/0028_traces.sql").into_sql_str();
    let quotas = include_str!("../../../../../migrations/sqlite/0029_quotas.sql").into_sql_str();
    let audit = include_str!("../../../../../migrations/sqlite/0030_audit.sql").into_sql_str();
    let shares = include_str!("../../../../../migrations/sqlite/0031_shares.sql").into_sql_str();
    let films = include_str!("../../../../../migrations/sqlite/0032_films.sql").into_sql_str();
    let webhooks =
        include_str!("../../../../../migrations/sqlite/0033_webhooks.sql").into_sql_str();
    let rates = include_str!("../../../../../migrations/sqlite/0034_rates.sql").into_sql_str();
    let retraining =
        include_str!("../../../../../migrations/sqlite/0035_retraining.sql").into_sql_str();
    let aliases = include_str!("../../../../../migrations/sqlite/0036_aliases.sql").into_sql_str();
    let evidence =
        include_str!("../../../../../migrations/sqlite/0037_evidence.sql").into_sql_str();
    let sessions =
        include_str!("../../../../../migrations/sqlite/0038_sessions.sql").into_sql_str();
    let step = |version, name: &'static str, sql, own_transaction| {
        let kind = MigrationType::Simple;
        Migration::new(version, name.into(), kind, sql, own_transaction)
    };
    Migrator::with_migrations(vec![
        step(1, "init", init, false),
        step(2, "evaluate jobs", evaluate, true),
        step(3, "tradeoffs", tradeoffs, false),
        step(4, "retries", retries, false),
        step(5, "trained slots", slots, false),
        step(6, "frame numbers", frames, false),
        step(7, "checkpoint shards", shards, false),
        step(8, "storage", storage, false),
        step(9, "jobs", jobs, false),
        step(10, "uploads", uploads, true),
        step(11, "render ranges", ranges, false),
        step(12, "scene models", models, false),
        step(13, "export jobs", exports, true),
        step(14, "clock steps", clock, false),
        step(15, "tenants", tenants, false),
        step(16, "stamps", stamps, false),
        step(17, "job metrics", metrics, false),
        step(18, "order levels", levels, false),
        step(19, "capture objects", files, false),
        step(21, "turns of tenants", turns, false),
        step(22, "shared state", shared, false),
        step(23, "upload parts", parts, false),
        step(24, "operators", operators, false),
        step(25, "several coordinators", several, false),
        step(26, "keys", keys, false),
        step(27, "consents", consents, false),
        step(28, "traces", traces, false),
        step(29, "quotas", quotas, false),
        step(30, "audit", audit, false),
        step(31, "shares", shares, false),
        step(32, "films", films, false),
        step(33, "webhooks", webhooks, false),
        step(34, "rates", rates, false),
        step(35, "retraining", retraining, false),
        step(36, "aliases", aliases, false),
        step(37, "evidence", evidence, false),
        step(38, "sessions", sessions, false),
    ])
}

/// Brings the schema up to date, unless the database is one that this program can't use.
///
/// # Errors
/// When the database is of another program or a newer version, or fails.
pub async fn run(writer: &SqlitePool) -> Result<(), StoreError> {
    let migrations = migrations();
    schema::check(&migrations, &found(writer).await?)?;
    let done = migrations.run(writer).await.map_err(sqlx::Error::from);
    done.during("bringing the database's schema up to date")
}

/// Whether the schema has to be brought up to date.
///
/// # Errors
/// As [`run`].
pub async fn are_pending(readers: &SqlitePool) -> Result<bool, StoreError> {
    schema::are_pending(&migrations(), &found(readers).await?)
}

/// What the database contains.
async fn found(writer: &SqlitePool) -> Result<Found, StoreError> {
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
    Ok(Found { tables, applied })
}
