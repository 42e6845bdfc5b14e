//! The address of a database.

use percent_encoding::percent_decode_str;
use std::fmt;
use std::str::FromStr;
use thiserror::Error;
use url::Url;

/// Address of a PostgreSQL database, `postgres://USER:PASSWORD@HOST:PORT/NAME?sslmode=…`. It is shown without its password
/// and its options.
#[derive(Clone, PartialEq, Eq)]
pub struct PostgresUrl(Url);

/// A text that is no address of a PostgreSQL database.
#[derive(Debug, Error, PartialEq, Eq)]
pub enum UrlError {
    /// It is no URL, or one of another kind.
    #[error("not an address of a PostgreSQL database: postgres://USER@HOST/NAME")]
    Form,
    /// It has no name of a database.
    #[error("it names no database: postgres://USER@HOST/NAME")]
    NoName,
}

impl PostgresUrl {
    /// The whole address, with the password.
    pub(super) fn secret(&self) -> &str {
        self.0.as_str()
    }

    /// The address without the password, and the password, for PostgreSQL's own programs.
    pub fn for_programs(&self) -> (String, Option<String>) {
        let mut address = self.0.clone();
        let password = address.password().map(|it| {
            let decoded = percent_decode_str(it).decode_utf8_lossy();
            decoded.into_owned()
        });
        // An address of a server can have a password, so this does not fail.
        let _ = address.set_password(None);
        (address.into(), password)
    }
}

impl FromStr for PostgresUrl {
    type Err = UrlError;

    fn from_str(text: &str) -> Result<Self, UrlError> {
        let url = Url::parse(text).map_err(|_| UrlError::Form)?;
        if !matches!(url.scheme(), "postgres" | "postgresql") || url.cannot_be_a_base() {
            return Err(UrlError::Form);
        }
        match url.path().trim_start_matches('/') {
            "" => Err(UrlError::NoName),
            _ => Ok(Self(url)),
        }
    }
}

impl fmt::Display for PostgresUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let url = &self.0;
        write!(f, "{}://", url.scheme())?;
        if !url.username().is_empty() {
            write!(f, "{}@", url.username())?;
        }
        write!(f, "{}", url.host_str().unwrap_or_default())?;
        if let Some(port) = url.port() {
            write!(f, ":{port}")?;
        }
        write!(f, "{}", url.path())
    }
}

impl fmt::Debug for PostgresUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_password_is_never_shown() {
        let text = "postgresql://yoto:secret@db.example:5433/people?sslmode=require&sslkey=key";
        let url: PostgresUrl = text.parse().expect("an address");
        assert_eq!(url.secret(), text);
        for shown in [format!("{url}"), format!("{url:?}")] {
            assert_eq!(shown, "postgresql://yoto@db.example:5433/people");
        }
    }

    #[test]
    fn programs_get_the_password_apart() {
        let url: PostgresUrl = "postgres://a:p%40ss@h/n?sslmode=require"
            .parse()
            .expect("good");
        let expected = "postgres://a@h/n?sslmode=require".to_owned();
        assert_eq!(url.for_programs(), (expected, Some("p@ss".to_owned())));
    }

    #[test]
    fn other_addresses_are_refused() {
        let parse = |text: &str| text.parse::<PostgresUrl>().expect_err(text);
        for other in [
            "people",
            "sqlite:people.db",
            "postgres:people",
            "mysql://h/people",
        ] {
            assert_eq!(parse(other), UrlError::Form);
        }
        for nameless in ["postgres://localhost", "postgres://localhost/"] {
            assert_eq!(parse(nameless), UrlError::NoName);
        }
    }
}
