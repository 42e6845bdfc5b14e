//! Databases of the last schema before the start, taken over by this program, and earlier ones, which are refused.

use super::Sqlite;
use super::migrations::{run, steps};
use crate::db::schema::START;
use crate::db::taken_over::{
    NOW, a_render_without_a_checkpoint_keeps_it, jobs_go_on, uploads_go_on,
};
use crate::{Store, StoreError, Tenant};
use sqlx::sqlite::{SqliteConnectOptions, SqlitePoolOptions};
use sqlx::{AssertSqlSafe, Executor, Row, SqlitePool};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tempfile::TempDir;
use yoto_process::clock::ManualClock;

/// A database of the last schema before the start, with rows in every table.
const BEFORE: &str = include_str!("../../../tests/data/step_38.sqlite.sql");
/// A render of an early version, which does not say which checkpoint it uses.
const LOOKS: &str = "INSERT INTO jobs (id, kind, model, spec, tenant) VALUES ('looks', 'render', 'm', x'', 'default')";

/// The store's database.
fn sqlite(store: &Store) -> &Sqlite {
    store.db.sqlite()
}

/// The file, without the store.
pub(crate) async fn plain(path: &Path) -> SqlitePool {
    let options = SqliteConnectOptions::new()
        .filename(path)
        .foreign_keys(true)
        .create_if_missing(true);
    let pool = SqlitePoolOptions::new().max_connections(1);
    pool.connect_with(options).await.expect("opens")
}

/// Makes [`BEFORE`] and changes it.
pub(crate) async fn before(more: &str) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("yoto.db");
    let pool = plain(&path).await;
    pool.execute(BEFORE).await.expect("writes");
    let more = AssertSqlSafe(more.to_owned());
    pool.execute(more).await.expect("writes");
    pool.close().await;
    (folder, path)
}

pub(crate) async fn open(path: &Path) -> Result<Store, StoreError> {
    Store::open_sqlite(path, Arc::new(ManualClock::at(NOW))).await
}

/// What a statement selects as `line`, sorted.
async fn lines(pool: &SqlitePool, statement: String) -> Vec<String> {
    let rows = pool.fetch_all(AssertSqlSafe(statement)).await;
    let rows = rows.expect("reads");
    let mut lines: Vec<String> = rows.iter().map(|it| it.get("line")).collect();
    lines.sort_unstable();
    lines
}

/// The rows of each table but that of the steps.
async fn rows(pool: &SqlitePool) -> BTreeMap<String, Vec<String>> {
    let tables = "SELECT name AS line FROM sqlite_schema WHERE type = 'table' AND name <> '_sqlx_migrations'";
    let mut found = BTreeMap::new();
    for table in lines(pool, tables.to_owned()).await {
        let columns =
            format!("SELECT 'quote(\"' || name || '\")' AS line FROM pragma_table_info('{table}')");
        let columns = lines(pool, columns).await.join(" || ' ' || ");
        let rows = lines(pool, format!("SELECT {columns} AS line FROM {table}")).await;
        found.insert(table, rows);
    }
    found
}

/// The definitions of tables without their order, of indices and of views.
async fn schema(pool: &SqlitePool) -> BTreeMap<String, BTreeSet<String>> {
    let all = "SELECT type, name, sql FROM sqlite_schema WHERE sql IS NOT NULL AND tbl_name <> '_sqlx_migrations'";
    let all = pool.fetch_all(all).await.expect("reads");
    let definition = |row: &sqlx::sqlite::SqliteRow| {
        let sql: String = row.get("sql");
        let uncommented = sql.lines().map(|it| it.split("--").next().unwrap_or(it));
        let text: Vec<&str> = uncommented.flat_map(str::split_whitespace).collect();
        // What was renamed is in quotes. SQLite writes an added column before a table's constraints, in a line of its own.
        let text = text.join(" ").replace('"', "").replace("( ", "(");
        let text = text.replace(" )", ")");
        let definition = match row.get("type") {
            "table" => parts(&text),
            _ => BTreeSet::from([text]),
        };
        (row.get("name"), definition)
    };
    all.iter().map(definition).collect()
}

/// The parts of a definition between the commas of its outer parentheses.
fn parts(definition: &str) -> BTreeSet<String> {
    let (mut parts, mut part, mut depth) = (BTreeSet::new(), String::new(), 0);
    for letter in definition.chars() {
        match letter {
            '(' => depth += 1,
            ')' => depth -= 1,
            _ => {}
        }
        let ends = depth == 1 && matches!(letter, ',' | '(') || depth == 0 && letter == ')';
        match ends {
            true => _ = parts.insert(std::mem::take(&mut part).trim().to_owned()),
            false => part.push(letter),
        }
    }
    parts.insert(part.trim().to_owned());
    parts
}

/// Tables that got a column by a later step.
const GROWN: [&str; 3] = ["cordons", "drains", "paused_kinds"];

#[tokio::test]
async fn the_last_schema_before_the_start_is_taken_over_with_its_rows() {
    let (folder, path) = before("").await;
    let pool = plain(&path).await;
    let (rows_before, schema_before) = (rows(&pool).await, schema(&pool).await);
    let empty: Vec<_> = rows_before
        .iter()
        .filter(|(_, rows)| rows.is_empty())
        .collect();
    assert!(empty.is_empty(), "{empty:?}");
    pool.close().await;

    let clock = Arc::new(ManualClock::at(NOW));
    let inspected = Store::inspect_sqlite(&path, clock.clone()).await;
    let inspected = inspected.expect_err("has to be brought up to date");
    let text = inspected.to_string();
    assert!(text.contains("of an earlier version"), "{text}");
    for _ in 0..2 {
        let taken = Sqlite::open_with(&path, &steps().start_alone()).await;
        let taken = taken.expect("takes over");
        taken.writer.close().await;
        taken.readers.close().await;
    }
    let pool = plain(&path).await;
    assert_eq!(rows(&pool).await, rows_before);
    assert_eq!(schema(&pool).await, schema_before);
    let done =
        "SELECT version || ' ' || description || ' ' || success AS line FROM _sqlx_migrations";
    let start = [format!("{START} start 1")];
    assert_eq!(lines(&pool, done.to_owned()).await, start);
    pool.close().await;

    open(&path).await.expect("opens").close().await;
    let read = Store::inspect_sqlite(&path, clock).await;
    read.expect("is up to date").close().await;
    open(&path).await.expect("opens again").close().await;
    let pool = plain(&path).await;
    let mut rows_after = rows(&pool).await;
    rows_after.retain(|table, rows| rows_before.contains_key(table) || !rows.is_empty());
    let mut rows_kept = rows_before;
    for grown in GROWN {
        let (before, after) = (rows_kept.remove(grown), rows_after.remove(grown));
        assert!(before.is_some_and(|it| !it.is_empty()) && after.is_some_and(|it| !it.is_empty()));
    }
    assert_eq!(rows_after, rows_kept);
    let schema_after = schema(&pool).await;
    pool.close().await;

    let fresh = folder.path().join("fresh.db");
    open(&fresh).await.expect("opens").close().await;
    let pool = plain(&fresh).await;
    assert_eq!(schema(&pool).await, schema_after);
    pool.close().await;
}

#[tokio::test]
async fn a_take_over_by_two_processes_is_one() {
    let (_folder, path) = before("").await;
    let (one, other) = (plain(&path).await, plain(&path).await);
    let (steps_of_one, steps_of_other) = (steps(), steps());
    let done = tokio::join!(run(&one, &steps_of_one), run(&other, &steps_of_other));
    done.0.expect("takes over");
    done.1.expect("takes over");
}

#[tokio::test]
async fn jobs_and_uploads_go_on_after_a_take_over() {
    let (_folder, path) = before(LOOKS).await;
    let store = open(&path).await.expect("takes over");
    a_render_without_a_checkpoint_keeps_it(&store).await;
    jobs_go_on(&store).await;
    uploads_go_on(&store).await;
    store.close().await;
}

#[tokio::test]
async fn an_earlier_schema_is_refused_with_the_program_that_brings_it_on() {
    let (_folder, path) = before("DELETE FROM _sqlx_migrations WHERE version > 31").await;
    let pool = plain(&path).await;
    let rows_before = rows(&pool).await;
    let refused = open(&path).await.expect_err("is too early");
    assert!(matches!(refused, StoreError::Unusable(_)), "{refused}");
    let text = refused.to_string();
    assert!(
        text.contains("has schema 31")
            && text.contains("the program of 28 November 2026 (commit 5ce29de0)")
            && text.contains("brings it to schema 38"),
        "{text}"
    );
    assert_eq!(rows(&pool).await, rows_before);
    let steps = "SELECT CAST(max(version) AS TEXT) AS line FROM _sqlx_migrations".to_owned();
    assert_eq!(lines(&pool, steps).await, ["31"]);
}

#[tokio::test]
async fn references_kinds_and_tenants_are_enforced() {
    let (_folder, path) = before("").await;
    let store = open(&path).await.expect("takes over");
    let execute = |statement: &'static str| sqlite(&store).writer.execute(statement);
    for (table, id) in [("workers", "w"), ("captures", "read"), ("keys", "key")] {
        let statement = AssertSqlSafe(format!("DELETE FROM {table} WHERE id = '{id}'"));
        let error = sqlite(&store).writer.execute(statement).await;
        let error = error.expect_err("a row refers to it").to_string();
        assert!(error.contains("FOREIGN KEY"), "{error}");
    }
    let deleted = execute("DELETE FROM jobs WHERE id = 'j'").await;
    deleted.expect("a checkpoint outlives its job");
    let own = Tenant::default();
    let checkpoints = store.checkpoints(&own, "m", 9).await.expect("are kept");
    assert_eq!(checkpoints.len(), 1);

    let kind = execute("INSERT INTO worker_kinds (worker, kind) VALUES ('w', 'export')").await;
    kind.expect("is a kind");
    let kind = execute(
        "INSERT INTO jobs (id, kind, model, spec, tenant) VALUES ('n', 'sing', 'm', x'', 'default')",
    );
    let error = kind.await.expect_err("not a kind of job").to_string();
    assert!(error.contains("CHECK"), "{error}");
    // A statement that forgets the tenant makes a row that no tenant finds.
    let forgotten = execute(
        "INSERT INTO models (id, display_name, tier, variant) VALUES ('n', 'n', 'draft', 'yoto')",
    );
    forgotten.await.expect("writes");
    store.model(&own, "n").await.expect_err("is nobody's");
}
