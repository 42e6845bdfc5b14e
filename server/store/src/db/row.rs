//! Rows, and the conversion between their columns and messages.

use crate::StoreError;
use prost::Message;
use prost_types::Timestamp;
use sqlx::postgres::PgRow;
use sqlx::sqlite::SqliteRow;
use sqlx::{Column, Decode, Postgres, Row as _, Sqlite, Type, TypeInfo};
use yoto_proto::v1::ObjectRef;

/// A row of any database.
#[derive(Debug)]
pub(crate) enum Row {
    /// A row of SQLite.
    Sqlite(SqliteRow),
    /// A row of PostgreSQL.
    Postgres(PgRow),
}

fn corrupt(what: &'static str, detail: impl ToString) -> StoreError {
    StoreError::Corrupt {
        what,
        detail: detail.to_string(),
    }
}

/// The enum value called `name`.
pub(crate) fn state<S>(
    column: &'static str,
    name: &str,
    parse: fn(&str) -> Option<S>,
) -> Result<S, StoreError> {
    parse(name).ok_or_else(|| corrupt(column, name))
}

/// `value` as the database's signed integer.
pub(crate) fn integer(field: &'static str, value: u64) -> Result<i64, StoreError> {
    i64::try_from(value).map_err(|_| StoreError::TooLarge { field, value })
}

fn is_condition(row: &PgRow, column: &str) -> bool {
    row.try_column(column)
        .is_ok_and(|it| it.type_info().name() == "BOOL")
}

/// The calendar of JSON's times, the years 1 to 9999, in seconds since 1970.
const CALENDAR: [f64; 2] = [-62_135_596_800.0, 253_402_300_799.0];

/// A time of the database, seconds since 1970. Times beyond the calendar, which earlier versions stored, become its ends.
pub(crate) fn timestamp(seconds: f64) -> Timestamp {
    let seconds = seconds.clamp(CALENDAR[0], CALENDAR[1]);
    Timestamp {
        seconds: seconds.floor() as i64,
        // Below 1e9 for every fraction, so the cast is exact enough and in range.
        nanos: ((seconds - seconds.floor()) * 1e9) as i32,
    }
}

impl Row {
    fn get<'r, T>(&'r self, column: &'static str) -> Result<T, StoreError>
    where
        T: Decode<'r, Sqlite> + Type<Sqlite> + Decode<'r, Postgres> + Type<Postgres>,
    {
        let value = match self {
            Self::Sqlite(row) => row.try_get(column),
            Self::Postgres(row) => row.try_get(column),
        };
        value.map_err(|error| corrupt(column, error))
    }

    /// A text column.
    ///
    /// # Errors
    /// When the column holds something else.
    pub(crate) fn text(&self, column: &'static str) -> Result<String, StoreError> {
        self.get(column)
    }

    /// A text column that may be NULL.
    ///
    /// # Errors
    /// When the column holds something else.
    pub(crate) fn maybe_text(&self, column: &'static str) -> Result<Option<String>, StoreError> {
        self.get(column)
    }

    /// An integer column that holds an unsigned number.
    ///
    /// # Errors
    /// When the column holds something else.
    pub(crate) fn number<N: TryFrom<i64>>(&self, column: &'static str) -> Result<N, StoreError> {
        let value: i64 = self.get(column)?;
        N::try_from(value).map_err(|_| corrupt(column, value))
    }

    /// An integer column that may be NULL.
    ///
    /// # Errors
    /// When the column holds something else.
    pub(crate) fn maybe_number<N: TryFrom<i64>>(
        &self,
        column: &'static str,
    ) -> Result<Option<N>, StoreError> {
        let value: Option<i64> = self.get(column)?;
        value
            .map(|value| N::try_from(value).map_err(|_| corrupt(column, value)))
            .transpose()
    }

    /// A number that may be NULL.
    ///
    /// # Errors
    /// When the column holds something else.
    pub(crate) fn real(&self, column: &'static str) -> Result<Option<f64>, StoreError> {
        self.get(column)
    }

    /// A 0/1 column, or a condition.
    ///
    /// # Errors
    /// When the column holds something else.
    pub(crate) fn flag(&self, column: &'static str) -> Result<bool, StoreError> {
        match self {
            // Conditions have a type of their own there.
            Self::Postgres(row) if is_condition(row, column) => self.get(column),
            _ => Ok(self.number::<i64>(column)? != 0),
        }
    }

    /// A time column, seconds since 1970.
    ///
    /// # Errors
    /// When the column holds something else.
    pub(crate) fn time(&self, column: &'static str) -> Result<Option<Timestamp>, StoreError> {
        Ok(self.real(column)?.map(timestamp))
    }

    /// A column of bytes.
    ///
    /// # Errors
    /// When the column holds something else.
    pub(crate) fn bytes(&self, column: &'static str) -> Result<Vec<u8>, StoreError> {
        self.get(column)
    }

    /// An encoded message that may be NULL.
    ///
    /// # Errors
    /// When the column holds something else.
    pub(crate) fn message<M: Message + Default>(
        &self,
        column: &'static str,
    ) -> Result<Option<M>, StoreError> {
        let bytes: Option<Vec<u8>> = self.get(column)?;
        bytes
            .map(|bytes| M::decode(bytes.as_slice()).map_err(|error| corrupt(column, error)))
            .transpose()
    }

    /// The three columns of an object reference.
    ///
    /// # Errors
    /// When the column holds something else.
    pub(crate) fn object(
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
