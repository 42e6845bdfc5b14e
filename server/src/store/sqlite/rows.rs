//! Conversion between columns and messages, with errors that name the action.

use super::failures;
use crate::store::StoreError;
use prost::Message;
use prost_types::Timestamp;
use sqlx::Row;
use sqlx::sqlite::SqliteRow;
use yoto_proto::v1::ObjectRef;

/// Adds the action to errors of the driver.
pub trait During<T> {
    /// Adds `action`, e.g. "reading a job", and classifies the failure.
    fn during(self, action: &'static str) -> Result<T, StoreError>;
}

impl<T> During<T> for Result<T, sqlx::Error> {
    fn during(self, action: &'static str) -> Result<T, StoreError> {
        self.map_err(|error| failures::of_driver(action, error))
    }
}

/// Typed reads of a row's columns.
pub trait Columns {
    /// A text column.
    fn text(&self, column: &'static str) -> Result<String, StoreError>;
    /// A text column that may be NULL.
    fn maybe_text(&self, column: &'static str) -> Result<Option<String>, StoreError>;
    /// An integer column that holds an unsigned number.
    fn number<N: TryFrom<i64>>(&self, column: &'static str) -> Result<N, StoreError>;
    /// An integer column that may be NULL.
    fn maybe_number<N: TryFrom<i64>>(&self, column: &'static str) -> Result<Option<N>, StoreError>;
    /// A number that may be NULL.
    fn real(&self, column: &'static str) -> Result<Option<f64>, StoreError>;
    /// A 0/1 column.
    fn flag(&self, column: &'static str) -> Result<bool, StoreError>;
    /// A time column, seconds since 1970.
    fn time(&self, column: &'static str) -> Result<Option<Timestamp>, StoreError>;
    /// An encoded message that may be NULL.
    fn message<M: Message + Default>(&self, column: &'static str) -> Result<Option<M>, StoreError>;
    /// The three columns of an object reference.
    fn object(
        &self,
        key: &'static str,
        bytes: &'static str,
        sha256: &'static str,
    ) -> Result<Option<ObjectRef>, StoreError>;
}

fn corrupt(what: &'static str, detail: impl ToString) -> StoreError {
    StoreError::Corrupt {
        what,
        detail: detail.to_string(),
    }
}

/// The enum value called `name`.
pub fn state<S>(
    column: &'static str,
    name: &str,
    parse: fn(&str) -> Option<S>,
) -> Result<S, StoreError> {
    parse(name).ok_or_else(|| corrupt(column, name))
}

/// `value` as the database's signed integer.
pub fn integer(field: &'static str, value: u64) -> Result<i64, StoreError> {
    i64::try_from(value).map_err(|_| StoreError::TooLarge { field, value })
}

impl Columns for SqliteRow {
    fn text(&self, column: &'static str) -> Result<String, StoreError> {
        self.try_get(column).map_err(|error| corrupt(column, error))
    }

    fn maybe_text(&self, column: &'static str) -> Result<Option<String>, StoreError> {
        self.try_get(column).map_err(|error| corrupt(column, error))
    }

    fn number<N: TryFrom<i64>>(&self, column: &'static str) -> Result<N, StoreError> {
        let value: i64 = self
            .try_get(column)
            .map_err(|error| corrupt(column, error))?;
        N::try_from(value).map_err(|_| corrupt(column, value))
    }

    fn maybe_number<N: TryFrom<i64>>(&self, column: &'static str) -> Result<Option<N>, StoreError> {
        let value: Option<i64> = self
            .try_get(column)
            .map_err(|error| corrupt(column, error))?;
        value
            .map(|value| N::try_from(value).map_err(|_| corrupt(column, value)))
            .transpose()
    }

    fn real(&self, column: &'static str) -> Result<Option<f64>, StoreError> {
        self.try_get(column).map_err(|error| corrupt(column, error))
    }

    fn flag(&self, column: &'static str) -> Result<bool, StoreError> {
        Ok(self.number::<i64>(column)? != 0)
    }

    fn time(&self, column: &'static str) -> Result<Option<Timestamp>, StoreError> {
        Ok(self.real(column)?.map(|seconds| Timestamp {
            seconds: seconds.floor() as i64,
            // Below 1e9 for every fraction, so the cast is exact enough and in range.
            nanos: ((seconds - seconds.floor()) * 1e9) as i32,
        }))
    }

    fn message<M: Message + Default>(&self, column: &'static str) -> Result<Option<M>, StoreError> {
        let bytes: Option<&[u8]> = self
            .try_get(column)
            .map_err(|error| corrupt(column, error))?;
        bytes
            .map(|bytes| M::decode(bytes).map_err(|error| corrupt(column, error)))
            .transpose()
    }

    fn object(
        &self,
        key: &'static str,
        bytes: &'static str,
        sha256: &'static str,
    ) -> Result<Option<ObjectRef>, StoreError> {
        let Some(key) = self.maybe_text(key)? else {
            return Ok(None);
        };
        Ok(Some(ObjectRef {
            key,
            bytes: self.number(bytes)?,
            sha256: self.text(sha256)?,
        }))
    }
}
