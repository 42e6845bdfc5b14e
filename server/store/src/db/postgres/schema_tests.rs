//! Databases that PostgreSQL's driver brings up to date, and those that it refuses.

use super::Postgres;
use super::migrations::steps;
use crate::db::schema::{START, Steps, with_a_later_step};
use crate::db::taken_over::{
    NOW, a_render_without_a_checkpoint_keeps_it, jobs_go_on, uploads_go_on,
};
use crate::db::{Driver, sqlite};
use crate::stage::{running_job_goes_on, taken_back_from_the_process_before};
use crate::{NewSubject, Store, StoreError, Tenant};
use sqlx::migrate::Migration;
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{ConnectOptions, Row};
use std::collections::BTreeMap;
use std::sync::Arc;
use yoto_process::clock::{ManualClock, SystemClock};
use yoto_test_postgres::{Database, is_there};

/// A database of the last schema before the start, with rows in every table.
const BEFORE: &str = include_str!("../../../tests/data/step_38.postgres.sql");

async fn open(database: &Database) -> Result<Store, StoreError> {
    let url = database.url().parse().expect("an address");
    Store::open_postgres(&url, Arc::new(SystemClock)).await
}

async fn open_at(database: &Database, clock: Arc<ManualClock>) -> Store {
    let url = database.url().parse().expect("an address");
    let store = Store::open_postgres(&url, clock).await;
    store.expect("opens")
}

/// The reason for which the database is refused.
async fn refusal(database: &Database) -> String {
    let error = open(database).await.expect_err("is refused");
    assert!(matches!(error, StoreError::Unusable(_)), "{error}");
    error.to_string()
}

fn person() -> NewSubject {
    NewSubject {
        display_name: "Ada".to_owned(),
        consent_note: String::new(),
    }
}

/// Steps have the same numbers and names as SQLite's.
#[test]
fn both_databases_have_the_same_steps() {
    let files = |folder: &str| {
        let folder = format!("{}/../../migrations/{folder}", env!("CARGO_MANIFEST_DIR"));
        let files = std::fs::read_dir(folder).expect("a folder");
        let names = files.map(|it| it.expect("a file").file_name());
        let mut names: Vec<String> = names.map(|it| it.into_string().expect("UTF-8")).collect();
        names.sort();
        names
    };
    let known = |steps: &Steps| {
        let migrator = steps.migrator();
        let name = |it: &Migration| format!("{:04}_{}.sql", it.version, it.description);
        let names: Vec<String> = migrator
            .iter()
            .map(|it| name(it).replace(' ', "_"))
            .collect();
        names
    };
    assert_eq!(known(&steps()), files("postgres"));
    assert_eq!(known(&sqlite::steps()), files("sqlite"));
    assert_eq!(files("sqlite"), files("postgres"));
}

#[tokio::test]
async fn both_databases_have_the_same_tables_and_columns() {
    if !is_there() {
        return;
    }
    let database = Database::create().expect("PostgreSQL");
    open(&database).await.expect("opens").close().await;
    let postgres = database.run(
        "SELECT table_name || ' ' || column_name FROM information_schema.columns
         WHERE table_schema = 'public' AND table_name <> '_sqlx_migrations'",
    );
    let mut postgres: Vec<&str> = postgres.lines().collect();
    postgres.sort_unstable();

    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("yoto.db");
    let store = Store::open_sqlite(&path, Arc::new(SystemClock)).await;
    store.expect("opens").close().await;
    let file = SqliteConnectOptions::new().filename(&path);
    let rows = sqlx::query(
        "SELECT t.name || ' ' || c.name AS line FROM sqlite_schema t JOIN pragma_table_info(t.name) c
         WHERE t.type IN ('table', 'view') AND t.name NOT LIKE 'sqlite%' AND t.name <> '_sqlx_migrations'",
    )
    .fetch_all(&mut file.connect().await.expect("opens"))
    .await
    .expect("reads");
    let mut sqlite: Vec<&str> = rows.iter().map(|row| row.get("line")).collect();
    sqlite.sort_unstable();
    assert_eq!(postgres, sqlite);
}

#[tokio::test]
async fn a_database_that_is_up_to_date_opens_again() {
    if !is_there() {
        return;
    }
    let database = Database::create().expect("PostgreSQL");
    let store = open(&database).await.expect("opens");
    let own = Tenant::default();
    let made = store.create_subject(&own, person(), None).await;
    let made = made.expect("creates");
    store.close().await;
    let store = open(&database).await.expect("opens again");
    let id = made.name.trim_start_matches("subjects/");
    assert_eq!(store.subject(&own, id).await.expect("is kept"), made);
}

/// Makes [`BEFORE`] and changes it.
fn before(more: &str) -> Database {
    let database = Database::create().expect("PostgreSQL");
    database.run(BEFORE);
    database.run(more);
    database
}

/// The database, opened by a program that is newer by one step.
async fn open_later(database: &Database) -> Result<Store, StoreError> {
    open_with(database, &with_a_later_step(steps())).await
}

async fn open_with(database: &Database, steps: &Steps) -> Result<Store, StoreError> {
    let url = database.url().parse().expect("an address");
    let opened = Postgres::open_with(&url, steps).await?;
    Ok(Store::of(crate::db::Database {
        driver: Driver::Postgres(opened.into()),
        clock: Arc::new(ManualClock::at(NOW)),
    }))
}

/// The rows of each table but that of the steps.
fn rows(database: &Database) -> BTreeMap<String, String> {
    let tables = database.run(
        "SELECT tablename FROM pg_tables WHERE schemaname = 'public' AND tablename <> '_sqlx_migrations'",
    );
    let rows = |table: &str| database.run(&format!("SELECT t::text FROM {table} t ORDER BY 1"));
    let tables = tables.lines().map(|it| (it.to_owned(), rows(it)));
    tables.collect()
}

/// Columns, constraints, indices and views.
fn schema(database: &Database) -> String {
    database.run(
        "SELECT concat_ws(' ', table_name, column_name, data_type, collation_name, is_nullable, column_default,
                          identity_generation) AS line
         FROM information_schema.columns WHERE table_schema = 'public' AND table_name <> '_sqlx_migrations'
         UNION ALL SELECT concat_ws(' ', conrelid::regclass, conname, pg_get_constraintdef(oid)) FROM pg_constraint
         WHERE connamespace = 'public'::regnamespace AND conrelid <> '_sqlx_migrations'::regclass
         UNION ALL SELECT indexdef FROM pg_indexes WHERE schemaname = 'public' AND tablename <> '_sqlx_migrations'
         UNION ALL SELECT viewname || ' ' || definition FROM pg_views WHERE schemaname = 'public'
         ORDER BY 1",
    )
}

/// Tables that got a column by a later step.
const GROWN: [&str; 3] = ["cordons", "drains", "paused_kinds"];

#[tokio::test]
async fn the_last_schema_before_the_start_is_taken_over_with_its_rows() {
    if !is_there() {
        return;
    }
    let database = before("");
    let (rows_before, schema_before) = (rows(&database), schema(&database));
    let empty: Vec<_> = rows_before
        .iter()
        .filter(|(_, rows)| rows.is_empty())
        .collect();
    assert!(empty.is_empty(), "{empty:?}");
    for _ in 0..2 {
        let taken = open_with(&database, &steps().start_alone()).await;
        taken.expect("takes over").close().await;
    }
    assert_eq!(rows(&database), rows_before);
    assert_eq!(schema(&database), schema_before);
    let done = "SELECT version, description, success FROM _sqlx_migrations";
    assert_eq!(database.run(done), format!("{START}|start|t"));

    for _ in 0..2 {
        open(&database).await.expect("opens").close().await;
    }
    let mut rows_after = rows(&database);
    rows_after.retain(|table, rows| rows_before.contains_key(table) || !rows.is_empty());
    let mut rows_kept = rows_before;
    for grown in GROWN {
        let (before, after) = (rows_kept.remove(grown), rows_after.remove(grown));
        assert!(before.is_some_and(|it| !it.is_empty()) && after.is_some_and(|it| !it.is_empty()));
    }
    assert_eq!(rows_after, rows_kept);
    let fresh = Database::create().expect("PostgreSQL");
    open(&fresh).await.expect("opens").close().await;
    assert_eq!(schema(&fresh), schema(&database));
}

#[tokio::test]
async fn jobs_and_uploads_go_on_after_a_take_over() {
    if !is_there() {
        return;
    }
    let database = before(
        "INSERT INTO jobs (id, kind, model, spec, create_time, tenant)
         VALUES ('looks', 'render', 'm', '', 1.5, 'default')",
    );
    let store = open_at(&database, Arc::new(ManualClock::at(NOW))).await;
    a_render_without_a_checkpoint_keeps_it(&store).await;
    jobs_go_on(&store).await;
    uploads_go_on(&store).await;
}

#[tokio::test]
async fn a_job_of_the_process_before_the_take_over_is_taken_back() {
    if !is_there() {
        return;
    }
    let database = before("UPDATE workers SET embedded = 1");
    let store = open_at(&database, Arc::new(ManualClock::at(NOW))).await;
    taken_back_from_the_process_before(&store).await;
}

#[tokio::test]
async fn an_earlier_schema_is_refused_with_the_program_that_brings_it_on() {
    if !is_there() {
        return;
    }
    let database = before("DELETE FROM _sqlx_migrations WHERE version > 31");
    let rows_before = rows(&database);
    let early = refusal(&database).await;
    assert!(
        early.contains("has schema 31")
            && early.contains("the program of 28 November 2026 (commit 5ce29de0)")
            && early.contains("brings it to schema 38"),
        "{early}"
    );
    assert_eq!(rows(&database), rows_before);
    let last = database.run("SELECT max(version) FROM _sqlx_migrations");
    assert_eq!(last, "31");
}

#[tokio::test]
async fn a_later_step_waits_for_coordinators_of_this_version_and_lets_no_others_in() {
    if !is_there() {
        return;
    }
    let database = before("");
    let clock = Arc::new(ManualClock::at(NOW));
    let store = open_at(&database, clock).await;
    let refused = open_later(&database).await.expect_err("it is in use");
    let refused = refused.to_string();
    assert!(refused.contains("of another version"), "{refused}");
    let renewed = store.db.renew().await;
    renewed.expect("the schema is that of before");
    store.close().await;

    let later = open_later(&database).await;
    let later = later.expect("brings it up to date");
    running_job_goes_on(&later).await;
    let newer = refusal(&database).await;
    let last = steps().newest();
    assert!(
        newer.contains(&format!("has schema {}", last + 1))
            && newer.contains(&format!("up to {last}")),
        "{newer}"
    );
    later.close().await;
    let column = database.run("SELECT later FROM jobs WHERE id = 'j'");
    assert_eq!(column, "7");
}

#[tokio::test]
async fn a_running_job_goes_on_after_a_take_over_and_a_later_step_at_once() {
    if !is_there() {
        return;
    }
    let database = before("");
    let later = open_later(&database).await;
    let later = later.expect("brings it up to date");
    running_job_goes_on(&later).await;
}

#[tokio::test]
async fn a_newer_schema_and_another_program_s_are_refused() {
    if !is_there() {
        return;
    }
    let database = Database::create().expect("PostgreSQL");
    open(&database).await.expect("opens").close().await;
    database.run(
        "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time)
         VALUES (9999, 'later', TRUE, '', 0)",
    );
    let newer = refusal(&database).await;
    assert!(newer.contains("has schema 9999"), "{newer}");

    let other = Database::create().expect("PostgreSQL");
    other.run("CREATE TABLE orders (id BIGINT)");
    let foreign = refusal(&other).await;
    assert!(foreign.contains("it has the table 'orders'"), "{foreign}");
    assert_eq!(
        other.run("SELECT count(*) FROM pg_tables WHERE schemaname = 'public'"),
        "1"
    );
}

#[tokio::test]
async fn a_call_after_a_restart_of_the_database_succeeds() {
    if !is_there() {
        return;
    }
    let database = Database::create().expect("PostgreSQL");
    let store = open(&database).await.expect("opens");
    for _ in 0..3 {
        let made = store
            .create_subject(&Tenant::default(), person(), None)
            .await;
        made.expect("creates");
        database.cut();
    }
}
