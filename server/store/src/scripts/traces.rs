//! A search of all rows for texts.

use crate::db::{Column, Tx};
use crate::{StoreError, Trace};

/// Tables that record the removal itself.
const OWN: [&str; 2] = ["erasures", "erasure_models"];

/// Each is a parameter, of which databases take a limited number.
const TEXTS_PER_STATEMENT: usize = 100;

/// Ends of the names of columns with ids, keys and checksums: random hex digits, in which a short name can occur.
const RANDOM: [&str; 11] = [
    "id",
    "sha256",
    "key",
    "subject",
    "capture",
    "model",
    "job",
    "worker",
    "folder",
    "consent",
    "trace_parent",
];

/// The columns of all tables whose rows have one of these ids, in a text or in bytes.
pub(crate) async fn of_ids(tx: &mut Tx, ids: &[String]) -> Result<Vec<Trace>, StoreError> {
    find(tx, ids, |_| true).await
}

/// The columns of texts and of encoded messages whose rows have this name.
pub(crate) async fn of_name(tx: &mut Tx, name: &str) -> Result<Vec<Trace>, StoreError> {
    // The audit log has no texts of callers.
    let is_text = |column: &Column| {
        column.table != "audit" && !RANDOM.iter().any(|end| column.name.ends_with(end))
    };
    find(tx, &[name.to_owned()], is_text).await
}

async fn find(
    tx: &mut Tx,
    texts: &[String],
    is_searched: impl Fn(&Column) -> bool,
) -> Result<Vec<Trace>, StoreError> {
    let mut found = Vec::new();
    if texts.is_empty() {
        return Ok(found);
    }
    for column in tx.columns().await? {
        if OWN.contains(&&*column.table) || !is_searched(&column) {
            continue;
        }
        let mut rows = 0;
        for some in texts.chunks(TEXTS_PER_STATEMENT) {
            rows += tx.rows_with(&column, some).await?;
        }
        if rows > 0 {
            found.push(Trace {
                table: column.table,
                column: column.name,
                rows,
            });
        }
    }
    Ok(found)
}
