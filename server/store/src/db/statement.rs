//! A statement with its values.
//!
//! The text is one that all databases read: parameters are `$1`, `$2`, …, flags are the integers 0 and 1, a row is
//! replaced by `ON CONFLICT`, and sums are cast to their column's type.

use sqlx::query::Query;
use sqlx::{AssertSqlSafe, Database, Encode, SqlSafeStr, Type};
use std::borrow::Cow;

/// A value of a parameter. Its type is known even if it is NULL.
#[derive(Debug, Clone)]
pub(crate) enum Value {
    /// A text.
    Text(Option<String>),
    /// An integer, or a flag as 0 or 1.
    Integer(Option<i64>),
    /// A number.
    Real(Option<f64>),
    /// An encoded message.
    Blob(Option<Vec<u8>>),
}

macro_rules! values {
    ($($variant:ident: $($from:ty),+;)+) => {
        $($(
            impl From<$from> for Value {
                fn from(value: $from) -> Self {
                    Self::$variant(Some(value.into()))
                }
            }
            impl From<Option<$from>> for Value {
                fn from(value: Option<$from>) -> Self {
                    Self::$variant(value.map(Into::into))
                }
            }
        )+)+
    };
}
values! {
    Text: &str, String, &String;
    Integer: i64, u32, u8, bool;
    Real: f64;
    Blob: Vec<u8>;
}

/// A statement, and the values of its parameters in their order.
#[derive(Debug)]
pub(crate) struct Statement {
    pub(super) text: Cow<'static, str>,
    pub(super) values: Vec<Value>,
}

/// A statement whose values are still to be bound.
pub(crate) fn sql(text: impl Into<Cow<'static, str>>) -> Statement {
    Statement {
        text: text.into(),
        values: Vec::new(),
    }
}

/// Where a driver locks the row of the table `q` that the statement has chosen ([`Tx::claim`](super::Tx::claim)).
macro_rules! claimed {
    () => {
        "/* claim q */"
    };
}
pub(crate) use claimed;

impl Statement {
    /// The statement with `lock` at the place of [`claimed!`].
    pub(super) fn claiming(self, lock: &str) -> Self {
        debug_assert!(
            self.text.contains(claimed!()),
            "{} claims nothing",
            self.text
        );
        Self {
            text: self.text.replace(claimed!(), lock).into(),
            values: self.values,
        }
    }

    /// Binds the next parameter.
    pub(crate) fn bind(mut self, value: impl Into<Value>) -> Self {
        self.values.push(value.into());
        self
    }

    /// Appends to the text.
    pub(crate) fn push(&mut self, text: &str) {
        self.text.to_mut().push_str(text);
    }

    /// Appends a parameter with its value.
    pub(crate) fn push_bind(&mut self, value: impl Into<Value>) {
        self.values.push(value.into());
        let number = self.values.len();
        self.push(&format!("${number}"));
    }

    /// Appends parameters with their values, separated by commas.
    pub(crate) fn push_all<V: Into<Value>>(&mut self, values: impl IntoIterator<Item = V>) {
        for (i, value) in values.into_iter().enumerate() {
            if i > 0 {
                self.push(", ");
            }
            self.push_bind(value);
        }
    }
}

/// The statement for a driver.
pub(super) fn query<DB: Database>(statement: Statement) -> Query<'static, DB, DB::Arguments>
where
    Option<String>: Encode<'static, DB> + Type<DB>,
    Option<i64>: Encode<'static, DB> + Type<DB>,
    Option<f64>: Encode<'static, DB> + Type<DB>,
    Option<Vec<u8>>: Encode<'static, DB> + Type<DB>,
{
    let text = match statement.text {
        Cow::Borrowed(text) => text.into_sql_str(),
        // Composed of texts of this program and of numbers of parameters.
        Cow::Owned(text) => AssertSqlSafe(text).into_sql_str(),
    };
    let query = sqlx::query(text);
    let values = statement.values.into_iter();
    values.fold(query, |query, value| match value {
        Value::Text(it) => query.bind(it),
        Value::Integer(it) => query.bind(it),
        Value::Real(it) => query.bind(it),
        Value::Blob(it) => query.bind(it),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn appended_parameters_are_numbered_on() {
        let mut statement = sql("SELECT $1 WHERE a IN (").bind("x");
        statement.push_all(["y", "z"]);
        statement.push(") LIMIT ");
        statement.push_bind(5_u32);
        assert_eq!(statement.text, "SELECT $1 WHERE a IN ($2, $3) LIMIT $4");
        assert!(matches!(statement.values[3], Value::Integer(Some(5))));
    }
}
