//! The rows of a page of a list.

use crate::db::Row;
use crate::{Entry, StoreError};

/// The items that `read` makes of rows, each with its position in the list.
pub(super) fn entries<T>(
    rows: &[Row],
    read: impl Fn(&Row) -> Result<T, StoreError>,
) -> Result<Vec<Entry<T>>, StoreError> {
    let entry = |row| {
        Ok(Entry {
            position: Row::number(row, "ord")?,
            item: read(row)?,
        })
    };
    rows.iter().map(entry).collect()
}
