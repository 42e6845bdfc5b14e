//! A search of all rows for texts.

use crate::store::db::Tx;
use crate::store::{StoreError, Trace};

/// Tables that record the removal itself.
const OWN: [&str; 2] = ["erasures", "erasure_models"];

/// Each is a parameter, of which databases take a limited number.
const TEXTS_PER_STATEMENT: usize = 100;

/// The columns of all tables whose rows have one of these texts, in a text or in bytes.
pub async fn find(tx: &mut Tx, texts: &[String]) -> Result<Vec<Trace>, StoreError> {
    let mut found = Vec::new();
    if texts.is_empty() {
        return Ok(found);
    }
    for column in tx.columns().await? {
        if OWN.contains(&&*column.table) {
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
