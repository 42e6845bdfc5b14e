//! Rows of SQLite, carried to PostgreSQL: both have the same tables and columns.

use super::BackupError;
use super::database::copy;
use crate::ServerError;
use sqlx::postgres::{PgArguments, PgConnectOptions};
use sqlx::query::Query;
use sqlx::sqlite::{SqliteConnectOptions, SqliteRow};
use sqlx::{
    AssertSqlSafe, ConnectOptions, Connection, PgConnection, Postgres, Row, SqliteConnection,
};
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;
use yoto_process::clock::SystemClock;
use yoto_store::{PostgresUrl, Store};

/// A table with its columns in their order.
struct Table {
    name: String,
    columns: Vec<Column>,
}

struct Column {
    name: String,
    kind: ColumnKind,
    /// Whether the database gives numbers to new rows.
    counted: bool,
}

/// Types of PostgreSQL's schema.
#[derive(Clone, Copy)]
enum ColumnKind {
    Integer,
    Real,
    Text,
    Bytes,
}

/// Copies the rows of the file `from` into the empty database at `url`, all or none, by way of a copy in `folder` that is
/// brought up to date.
pub(super) async fn carry(
    from: &Path,
    folder: &Path,
    url: &PostgresUrl,
) -> Result<(), BackupError> {
    let scratch = folder.join("carried");
    std::fs::create_dir(&scratch).map_err(BackupError::file("creating", &scratch))?;
    let carried = carry_by(from, &scratch.join("rows.db"), url).await;
    std::fs::remove_dir_all(&scratch).map_err(BackupError::file("removing", &scratch))?;
    carried
}

async fn carry_by(from: &Path, by: &Path, url: &PostgresUrl) -> Result<(), BackupError> {
    copy(from, by).await?;
    let newest = Store::open_sqlite(by, Arc::new(SystemClock)).await;
    newest.map_err(ServerError::from)?.close().await;
    let tables = Store::open_postgres(url, Arc::new(SystemClock)).await;
    tables.map_err(ServerError::from)?.close().await;

    let file = SqliteConnectOptions::new().filename(by).read_only(true);
    let mut file = file.connect().await?;
    let mut database = connect(url).await?;
    let mut tx = database.begin().await?;
    for table in tables_of(&mut tx).await? {
        if is_filled(&mut tx, &table).await? {
            return Err(BackupError::RowsThere { table: table.name });
        }
        fill(&mut file, &mut tx, &table).await?;
    }
    tx.commit().await?;
    file.close().await?;
    Ok(database.close().await?)
}

async fn connect(url: &PostgresUrl) -> Result<PgConnection, BackupError> {
    let (address, password) = url.for_programs();
    let mut options: PgConnectOptions = address.parse()?;
    if let Some(password) = password {
        options = options.password(&password);
    }
    Ok(options.connect().await?)
}

/// The tables, each after those to which its rows refer.
async fn tables_of(database: &mut PgConnection) -> Result<Vec<Table>, BackupError> {
    let rows = sqlx::query(
        "SELECT c.table_name::text, c.column_name::text, c.data_type::text, c.is_identity = 'YES' AS counted
         FROM information_schema.columns c JOIN information_schema.tables t
             ON t.table_schema = c.table_schema AND t.table_name = c.table_name
         WHERE c.table_schema = current_schema() AND t.table_type = 'BASE TABLE' AND c.table_name <> '_sqlx_migrations'
         ORDER BY c.table_name, c.ordinal_position",
    )
    .fetch_all(&mut *database)
    .await?;
    let mut tables: Vec<Table> = Vec::new();
    for row in rows {
        let table: String = row.try_get("table_name")?;
        let kind: String = row.try_get("data_type")?;
        let kind = match kind.as_str() {
            "bigint" => ColumnKind::Integer,
            "double precision" => ColumnKind::Real,
            "text" => ColumnKind::Text,
            "bytea" => ColumnKind::Bytes,
            _ => return Err(BackupError::Type { table, kind }),
        };
        let column = Column {
            name: row.try_get("column_name")?,
            kind,
            counted: row.try_get("counted")?,
        };
        match tables.last_mut().filter(|last| last.name == table) {
            Some(last) => last.columns.push(column),
            None => tables.push(Table {
                name: table,
                columns: vec![column],
            }),
        }
    }
    let references = sqlx::query(
        "SELECT c.relname::text AS child, p.relname::text AS parent
         FROM pg_constraint k JOIN pg_class c ON c.oid = k.conrelid JOIN pg_class p ON p.oid = k.confrelid
         WHERE k.contype = 'f' AND k.connamespace = current_schema()::regnamespace",
    )
    .fetch_all(database)
    .await?;
    let references = references.iter().map(|row| {
        let (child, parent) = (row.try_get("child")?, row.try_get("parent")?);
        Ok((child, parent))
    });
    let references: Vec<(String, String)> = references.collect::<Result<_, sqlx::Error>>()?;
    Ok(ordered(tables, &references))
}

/// `tables` in an order in which each (child, parent) of `references` has its parent first.
fn ordered(mut tables: Vec<Table>, references: &[(String, String)]) -> Vec<Table> {
    let mut ordered: Vec<Table> = Vec::with_capacity(tables.len());
    let mut done = BTreeSet::new();
    while !tables.is_empty() {
        let waits = |it: &Table| {
            let mut parents = references.iter().filter(|(child, _)| *child == it.name);
            parents.any(|(child, parent)| parent != child && !done.contains(parent))
        };
        let (later, now): (Vec<Table>, Vec<Table>) = tables.into_iter().partition(waits);
        // A circle of references has no order: PostgreSQL then refuses a row, and nothing is carried.
        let (now, later) = match now.is_empty() {
            true => (later, now),
            false => (now, later),
        };
        done.extend(now.iter().map(|it| it.name.clone()));
        ordered.extend(now);
        tables = later;
    }
    ordered
}

async fn is_filled(database: &mut PgConnection, table: &Table) -> Result<bool, BackupError> {
    let statement = format!("SELECT EXISTS (SELECT 1 FROM {}) AS found", table.name);
    let row = sqlx::query(AssertSqlSafe(statement)).fetch_one(database);
    Ok(row.await?.try_get("found")?)
}

/// Copies the rows of a table, and lets the database number later ones after them.
async fn fill(
    file: &mut SqliteConnection,
    database: &mut PgConnection,
    table: &Table,
) -> Result<(), BackupError> {
    let columns: Vec<&str> = table.columns.iter().map(|it| it.name.as_str()).collect();
    let columns = columns.join(", ");
    let places: Vec<String> = (1..=table.columns.len())
        .map(|it| format!("${it}"))
        .collect();
    let select = format!("SELECT {columns} FROM {}", table.name);
    let insert = format!(
        "INSERT INTO {} ({columns}) OVERRIDING SYSTEM VALUE VALUES ({})",
        table.name,
        places.join(", ")
    );
    let rows = sqlx::query(AssertSqlSafe(select)).fetch_all(file).await?;
    for row in &rows {
        let mut query = sqlx::query(AssertSqlSafe(insert.clone()));
        for (index, column) in table.columns.iter().enumerate() {
            query = bound(query, row, index, column.kind)?;
        }
        query.execute(&mut *database).await?;
    }
    for column in table.columns.iter().filter(|it| it.counted) {
        let statement = format!(
            "SELECT setval(pg_get_serial_sequence($1, $2), greatest(max({}), 1)) FROM {}",
            column.name, table.name
        );
        sqlx::query(AssertSqlSafe(statement))
            .bind(&table.name)
            .bind(&column.name)
            .execute(&mut *database)
            .await?;
    }
    Ok(())
}

fn bound<'q>(
    query: Query<'q, Postgres, PgArguments>,
    row: &SqliteRow,
    index: usize,
    kind: ColumnKind,
) -> Result<Query<'q, Postgres, PgArguments>, sqlx::Error> {
    Ok(match kind {
        ColumnKind::Integer => query.bind(row.try_get::<Option<i64>, _>(index)?),
        ColumnKind::Real => query.bind(row.try_get::<Option<f64>, _>(index)?),
        ColumnKind::Text => query.bind(row.try_get::<Option<String>, _>(index)?),
        ColumnKind::Bytes => query.bind(row.try_get::<Option<Vec<u8>>, _>(index)?),
    })
}
