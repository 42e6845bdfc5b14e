//! A search for a text in all that a service keeps, by other means than its own.

use super::{Database, Service};
use sqlx::postgres::PgConnectOptions;
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{AssertSqlSafe, ConnectOptions, Row};

/// Whether `bytes` have `text` somewhere.
fn has(bytes: &[u8], text: &str) -> bool {
    bytes.windows(text.len()).any(|it| it == text.as_bytes())
}

impl Service {
    /// Where `text` is: tables of the database, and files of the object store.
    pub(crate) async fn residue(&self, text: &str) -> Vec<String> {
        let mut found = self.database.residue(text).await;
        for path in self.stored_files() {
            let name = path.to_string_lossy().into_owned();
            let bytes = std::fs::read(&path).expect("is readable");
            if has(&bytes, text) || name.contains(text) {
                found.push(name);
            }
        }
        found
    }
}

impl Database {
    pub(crate) async fn residue(&self, text: &str) -> Vec<String> {
        match self {
            Self::Sqlite(path) => {
                let options = SqliteConnectOptions::new().filename(path);
                let mut connection = options.connect().await.expect("opens");
                let folder = tempfile::tempdir().expect("a folder");
                // A copy of all rows, without pages that are free.
                let copy = folder.path().join("copy.db");
                let statement = format!("VACUUM INTO '{}'", copy.display());
                let copied = sqlx::query(AssertSqlSafe(statement)).execute(&mut connection);
                copied.await.expect("copies");
                let bytes = std::fs::read(copy).expect("is readable");
                has(&bytes, text)
                    .then(|| "the database".to_owned())
                    .into_iter()
                    .collect()
            }
            Self::Postgres(it) => {
                let options: PgConnectOptions = it.url().parse().expect("an address");
                let mut connection = options.connect().await.expect("connects");
                let tables =
                    "SELECT tablename::text FROM pg_tables WHERE schemaname = current_schema()";
                let tables = sqlx::query(tables).fetch_all(&mut connection).await;
                let mut found = Vec::new();
                for table in tables.expect("lists") {
                    let table: String = table.get(0);
                    let statement = format!(
                        "SELECT count(*) FROM {table} t WHERE strpos(t::text, $1) > 0 OR strpos(t::text, $2) > 0"
                    );
                    let query = sqlx::query(AssertSqlSafe(statement)).bind(text.to_owned());
                    let query = query.bind(yoto_proto::hex(text.as_bytes()));
                    let rows = query.fetch_one(&mut connection).await.expect("searches");
                    if rows.get::<i64, _>(0) > 0 {
                        found.push(table);
                    }
                }
                found
            }
        }
    }
}
