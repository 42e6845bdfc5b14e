//! A transaction of any database.

use super::locks::{Lock, Locks};
use super::{Row, Statement, postgres, sql, sqlite};
use crate::StoreError;
use std::time::Instant;
use yoto_process::faults::{self, Moment};
use yoto_process::metrics::METRICS;
use yoto_process::statements;

/// A transaction: the only way of the store's scripts to the database.
#[derive(Debug)]
pub(crate) struct Tx {
    driver: Driver,
    now: f64,
    /// Whether the database's own clock told `now`.
    of_database: bool,
    locks: Locks,
}

/// A column of texts or bytes, by its names in this program's own schema.
#[derive(Debug, Clone)]
pub(crate) struct Column {
    /// Its table.
    pub table: String,
    /// Its name.
    pub name: String,
    /// Whether it holds bytes.
    pub bytes: bool,
}

/// A connection of a driver. Work on that of PostgreSQL is on the heap: a script has a hundred statements, and each would
/// hold the state of sqlx's protocol on the stack of a build without optimisation.
#[derive(Debug)]
pub(super) enum Driver {
    Sqlite(sqlite::Connection),
    Postgres(postgres::Connection),
}

impl Tx {
    pub(super) fn begin(driver: Driver, now: f64, of_database: bool) -> Self {
        Self {
            driver,
            now,
            of_database,
            locks: Locks::default(),
        }
    }

    /// The time of this transaction, seconds since 1970: read once, by the store's clock, and after a wait for one of the locks
    /// without an id. A script that needs a time takes this one.
    pub(crate) fn now(&self) -> f64 {
        self.now
    }

    /// Waits until no other transaction holds `lock`, and holds it until this one ends. Locks are taken in the order of
    /// [`Lock`]. SQLite has one writer, which holds all of them, so only the order is checked there.
    ///
    /// # Errors
    /// When the database fails.
    pub(crate) async fn lock(&mut self, lock: Lock<'_>) -> Result<(), StoreError> {
        self.locks.take(lock);
        match &mut self.driver {
            // BEGIN IMMEDIATE has locked the whole file.
            Driver::Sqlite(_) => Ok(()),
            Driver::Postgres(it) => {
                let now = Box::pin(it.lock(lock)).await?;
                if let Some(now) = now.filter(|_| self.of_database) {
                    self.now = now;
                }
                Ok(())
            }
        }
    }

    /// The row that `choice` selects, locked, or the next one in its order if another transaction has locked that.
    /// The caller changes the row under the same condition. The statement has [`claimed!`](super::claimed) after the LIMIT of
    /// its order.
    ///
    /// # Errors
    /// When the statement fails.
    pub(crate) async fn claim(
        &mut self,
        choice: Statement,
        action: &'static str,
    ) -> Result<Option<Row>, StoreError> {
        let choice = match &self.driver {
            // No other transaction writes at the same time.
            Driver::Sqlite(_) => choice,
            Driver::Postgres(_) => choice.claiming("FOR NO KEY UPDATE OF q SKIP LOCKED"),
        };
        choice.row(self, action).await
    }

    /// Tables and columns of the schema whose names end in `end`.
    ///
    /// # Errors
    /// When the database fails.
    pub(crate) async fn columns_named(
        &mut self,
        end: &str,
    ) -> Result<Vec<(String, String)>, StoreError> {
        let statement = match &self.driver {
            Driver::Sqlite(_) => sql("SELECT t.name AS table_name, c.name AS column_name
                 FROM sqlite_schema t JOIN pragma_table_info(t.name) c
                 WHERE t.type = 'table' AND substr(c.name, -length($1)) = $1"),
            Driver::Postgres(_) => sql("SELECT c.table_name::text, c.column_name::text
                 FROM information_schema.columns c JOIN information_schema.tables t
                     ON t.table_schema = c.table_schema AND t.table_name = c.table_name
                 WHERE c.table_schema = current_schema() AND t.table_type = 'BASE TABLE'
                     AND right(c.column_name, length($1)) = $1"),
        };
        let rows = statement.bind(end).rows(self, "reading the schema").await?;
        rows.iter()
            .map(|row| Ok((row.text("table_name")?, row.text("column_name")?)))
            .collect()
    }

    /// The columns of all tables that hold texts or bytes.
    ///
    /// # Errors
    /// When the database fails.
    pub(crate) async fn columns(&mut self) -> Result<Vec<Column>, StoreError> {
        let statement = match &self.driver {
            Driver::Sqlite(_) => sql("SELECT t.name AS table_name, c.name AS column_name, c.type = 'BLOB' AS bytes
                 FROM sqlite_schema t JOIN pragma_table_info(t.name) c
                 WHERE t.type = 'table' AND c.type IN ('TEXT', 'BLOB')
                     AND substr(t.name, 1, 1) <> '_' AND substr(t.name, 1, 7) <> 'sqlite_' ORDER BY 1, 2"),
            Driver::Postgres(_) => sql("SELECT c.table_name::text, c.column_name::text, c.data_type = 'bytea' AS bytes
                 FROM information_schema.columns c JOIN information_schema.tables t
                     ON t.table_schema = c.table_schema AND t.table_name = c.table_name
                 WHERE c.table_schema = current_schema() AND t.table_type = 'BASE TABLE'
                     AND c.data_type IN ('text', 'bytea') AND left(c.table_name, 1) <> '_' ORDER BY 1, 2"),
        };
        let rows = statement.rows(self, "reading the schema").await?;
        rows.iter()
            .map(|row| {
                Ok(Column {
                    table: row.text("table_name")?,
                    name: row.text("column_name")?,
                    bytes: row.flag("bytes")?,
                })
            })
            .collect()
    }

    /// Number of rows that have one of these texts in the column, also among its bytes.
    ///
    /// # Errors
    /// When the database fails.
    pub(crate) async fn rows_with(
        &mut self,
        column: &Column,
        texts: &[String],
    ) -> Result<u64, StoreError> {
        let Column { table, name, bytes } = column;
        let (before, after) = match (&self.driver, bytes) {
            (Driver::Sqlite(_), _) => (
                format!("instr(CAST({name} AS BLOB), CAST("),
                " AS BLOB)) > 0".to_owned(),
            ),
            (Driver::Postgres(_), true) => (
                "position(convert_to(".to_owned(),
                format!(", 'UTF8') IN {name}) > 0"),
            ),
            (Driver::Postgres(_), false) => ("position(".to_owned(), format!(" IN {name}) > 0")),
        };
        let mut statement = sql(format!("SELECT count(*) AS found FROM {table} WHERE "));
        for (number, text) in texts.iter().enumerate() {
            statement.push(if number == 0 { "" } else { " OR " });
            statement.push(&before);
            statement.push_bind(text);
            statement.push(&after);
        }
        statement.one(self, "searching rows").await?.number("found")
    }

    /// Makes the changes of a transaction that writes durable.
    ///
    /// # Errors
    /// When the database fails. It is unknown then whether they are.
    pub(crate) async fn commit(self) -> Result<(), StoreError> {
        faults::reached(Moment::BeforeCommit);
        let began = Instant::now();
        match self.driver {
            Driver::Sqlite(connection) => connection.commit().await?,
            Driver::Postgres(connection) => Box::pin(connection.commit()).await?,
        }
        METRICS.committed(began.elapsed());
        faults::reached(Moment::AfterCommit);
        Ok(())
    }

    async fn fetch(
        &mut self,
        statement: Statement,
        action: &'static str,
    ) -> Result<Option<Row>, StoreError> {
        statements::sent();
        match &mut self.driver {
            Driver::Sqlite(it) => Ok(it.row(statement, action).await?.map(Row::Sqlite)),
            Driver::Postgres(it) => {
                let row = Box::pin(it.row(statement, action)).await?;
                Ok(row.map(Row::Postgres))
            }
        }
    }

    async fn fetch_all(
        &mut self,
        statement: Statement,
        action: &'static str,
    ) -> Result<Vec<Row>, StoreError> {
        statements::sent();
        match &mut self.driver {
            Driver::Sqlite(it) => {
                let rows = it.rows(statement, action).await?.into_iter();
                Ok(rows.map(Row::Sqlite).collect())
            }
            Driver::Postgres(it) => {
                let rows = Box::pin(it.rows(statement, action)).await?.into_iter();
                Ok(rows.map(Row::Postgres).collect())
            }
        }
    }

    async fn run(&mut self, statement: Statement, action: &'static str) -> Result<u64, StoreError> {
        statements::sent();
        match &mut self.driver {
            Driver::Sqlite(it) => it.execute(statement, action).await,
            Driver::Postgres(it) => Box::pin(it.execute(statement, action)).await,
        }
    }
}

impl Statement {
    /// The first row, if there is one.
    ///
    /// # Errors
    /// When the statement fails during `action`.
    pub(crate) async fn row(
        self,
        tx: &mut Tx,
        action: &'static str,
    ) -> Result<Option<Row>, StoreError> {
        tx.fetch(self, action).await
    }

    /// The row of a statement that always has one.
    ///
    /// # Errors
    /// When the statement fails during `action`, or has none.
    pub(crate) async fn one(self, tx: &mut Tx, action: &'static str) -> Result<Row, StoreError> {
        let row = tx.fetch(self, action).await?;
        row.ok_or(StoreError::Corrupt {
            what: action,
            detail: "a row is missing".to_owned(),
        })
    }

    /// All rows.
    ///
    /// # Errors
    /// When the statement fails during `action`.
    pub(crate) async fn rows(
        self,
        tx: &mut Tx,
        action: &'static str,
    ) -> Result<Vec<Row>, StoreError> {
        tx.fetch_all(self, action).await
    }

    /// Runs the statement. Returns the number of changed rows.
    ///
    /// # Errors
    /// When the statement fails during `action`.
    pub(crate) async fn execute(
        self,
        tx: &mut Tx,
        action: &'static str,
    ) -> Result<u64, StoreError> {
        tx.run(self, action).await
    }
}
