//! Databases that PostgreSQL's driver brings up to date, and those that it refuses.

use super::migrations::migrations;
use crate::Tenant;
use crate::stage::{running_job_goes_on, taken_back_from_the_process_before};
use crate::{NewSubject, Store, StoreError};
use sqlx::postgres::PgConnectOptions;
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{ConnectOptions, Row};
use std::sync::Arc;
use yoto_process::clock::{ManualClock, SystemClock};
use yoto_test_postgres::{Database, is_there};

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

/// Steps have the same numbers and names as SQLite's, from the first one on, which stands for SQLite's steps up to its number.
#[test]
fn both_databases_have_the_same_steps() {
    let steps = |folder: &str| {
        let folder = format!("{}/../../migrations/{folder}", env!("CARGO_MANIFEST_DIR"));
        let files = std::fs::read_dir(folder).expect("a folder");
        let names = files.map(|it| it.expect("a file").file_name());
        let mut names: Vec<String> = names.map(|it| it.into_string().expect("UTF-8")).collect();
        names.sort();
        names
    };
    let (sqlite, postgres) = (steps("sqlite"), steps("postgres"));
    let (init, later) = postgres.split_first().expect("a first step");
    let base = init.strip_suffix("_init.sql").expect("its name");
    let (earlier, same): (Vec<_>, Vec<_>) = sqlite.into_iter().partition(|it| &it[..4] <= base);
    assert_eq!(earlier.last().map(|it| &it[..4]), Some(base));
    assert_eq!(same, later);
    let known: Vec<String> = migrations()
        .iter()
        .map(|it| format!("{:04}", it.version))
        .collect();
    let files: Vec<&str> = postgres.iter().map(|it| &it[..4]).collect();
    assert_eq!(known, files, "each file is a step of the program");
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

/// What a service of each earlier schema has while a worker trains: a RUNNING job with its lease and its pins.
const RUNNING: &str = r"
    INSERT INTO subjects (id, display_name, consent_note, create_time, tenant) VALUES ('s', 'Ada', '', 1.5, 'default');
    INSERT INTO captures (id, subject, state, shard_key, shard_bytes, shard_sha256, create_time, idle_since)
        VALUES ('c', 's', 'READY', 'k', 1, 'x', 1.5, 1.5);
    INSERT INTO models (id, display_name, tier, variant, create_time, tenant)
        VALUES ('m', 'm', 'draft', 'yoto', 1.5, 'default');
    INSERT INTO slots (model, slot, subject) VALUES ('m', 0, 's');
    INSERT INTO workers (id, display_name, backend, adapter, gpu, memory_bytes, create_time, tenant)
        VALUES ('w', 'w', 'cpu', 'cpu', 0, 0, 1.5, 'default');
    INSERT INTO worker_kinds VALUES ('w', 'train');
    INSERT INTO jobs (id, kind, model, state, spec, lease, last_token, worker, lease_deadline, create_time, tenant)
        VALUES ('j', 'train', 'm', 'RUNNING', '\x120A0A086D6F64656C732F6D', 77, 77, 'w', 1e10, 1.5, 'default');
    INSERT INTO job_attempts (job, lease, worker, begin_time) VALUES ('j', 77, 'w', 1.5);
    INSERT INTO job_captures (job, subject, capture) VALUES ('j', 's', 'c');
    INSERT INTO lease_clock (id, last_tick) VALUES (1, 1.5);
";

/// A database with the schema of `version` and a running job, opened by this program.
async fn upgraded(database: &Database, version: i64) -> Store {
    let options: PgConnectOptions = database.url().parse().expect("an address");
    let mut connection = options.connect().await.expect("connects");
    let done = migrations().run_to(version, &mut connection).await;
    done.expect("the old schema");
    database.run(RUNNING);
    open_at(database, Arc::new(ManualClock::at(2.0))).await
}

#[tokio::test]
async fn a_running_job_goes_on_after_the_upgrade_of_each_earlier_schema() {
    if !is_there() {
        return;
    }
    let versions: Vec<i64> = migrations().iter().map(|it| it.version).collect();
    let (_, earlier) = versions.split_last().expect("a schema");
    for version in earlier {
        let database = Database::create().expect("PostgreSQL");
        let store = upgraded(&database, *version).await;
        let own = Tenant::default();
        running_job_goes_on(&store, 1).await;
        let again = store.lease_job(&own, "w", "", false, 20.0).await;
        let again = again.expect("answers").leased;
        assert_eq!(
            again.map(|it| it.job.name),
            None,
            "a worker of before understands no orders"
        );
    }
}

#[tokio::test]
async fn a_job_of_the_process_before_the_upgrade_is_taken_back() {
    if !is_there() {
        return;
    }
    let versions = migrations();
    let first = versions.iter().map(|it| it.version).min();
    let database = Database::create().expect("PostgreSQL");
    let store = upgraded(&database, first.expect("a schema")).await;
    database.run("UPDATE workers SET embedded = 1");
    taken_back_from_the_process_before(&store).await;
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
