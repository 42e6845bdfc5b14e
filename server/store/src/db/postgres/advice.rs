//! Why a database can't be used at the start, with what to do about it.

use crate::StoreError;
use sqlx::postgres::PgConnectOptions;
use std::error::Error;
use std::fmt::Display;
use std::io::ErrorKind;

/// The refusal for an error of the first connection, or of bringing the schema up to date.
pub(super) fn refusal(error: sqlx::Error, options: &PgConnectOptions) -> StoreError {
    match advice(&error, options) {
        Some(advice) => StoreError::Unusable(advice),
        None => StoreError::Database {
            action: "connecting to the database",
            cause: error.into(),
        },
    }
}

fn advice(error: &sqlx::Error, options: &PgConnectOptions) -> Option<String> {
    let address = format!("{}:{}", options.get_host(), options.get_port());
    let name = options.get_database().unwrap_or_default();
    let user = options.get_username();
    let unreached = |reason: &dyn Display, advice| {
        Some(format!(
            "can't be reached at {address} ({reason}): {advice}"
        ))
    };
    let certificate = "correct sslmode or sslrootcert in the URL, or the server's certificate";
    match error {
        sqlx::Error::Tls(error) => return unreached(error, certificate),
        // What the encryption finds while it shakes hands.
        sqlx::Error::Io(error) if error.kind() == ErrorKind::InvalidData => {
            return unreached(error, certificate);
        }
        // A file of the URL: the folder of a socket, or a certificate.
        sqlx::Error::Io(error) if error.kind() == ErrorKind::NotFound => {
            return unreached(error, "correct host or sslrootcert in the URL");
        }
        sqlx::Error::Io(error) => {
            return unreached(error, "start its server, or correct the address");
        }
        _ => {}
    }
    let (code, message) = of_database(error)?;
    // https://www.postgresql.org/docs/current/errcodes-appendix.html
    let advice = match code.as_str() {
        // invalid_catalog_name
        "3D000" => format!(
            "create it with `createdb --encoding=UTF8 --template=template0 {name}`, or correct the name"
        ),
        // invalid_authorization_specification, invalid_password
        "28000" | "28P01" => {
            "correct the user in the URL, or the password there, in PGPASSWORD or in ~/.pgpass"
                .to_owned()
        }
        // insufficient_privilege
        "42501" => format!("let {user} own it: `ALTER DATABASE {name} OWNER TO {user}`"),
        // too_many_connections
        "53300" => "raise max_connections of its server, or stop another coordinator".to_owned(),
        _ => return None,
    };
    Some(format!("can't be used ({message}): {advice}"))
}

/// SQLSTATE and message of the database's own error in `error`.
fn of_database(error: &sqlx::Error) -> Option<(String, String)> {
    let mut cause: Option<&(dyn Error + 'static)> = Some(error);
    while let Some(error) = cause {
        if let Some(error) = error.downcast_ref::<sqlx::Error>()
            && let Some(error) = error.as_database_error()
        {
            return Some((error.code()?.into_owned(), error.message().to_owned()));
        }
        cause = error.source();
    }
    None
}

#[cfg(test)]
mod tests {
    use crate::{Store, StoreError};
    use std::sync::Arc;
    use yoto_process::clock::SystemClock;
    use yoto_test_postgres::{Database, is_there};

    /// The refusal of the database at `url`.
    async fn refusal(url: &str) -> String {
        let url = url.parse().expect("an address");
        let refused = Store::open_postgres(&url, Arc::new(SystemClock)).await;
        let refused = refused.expect_err("is refused");
        assert!(matches!(refused, StoreError::Unusable(_)), "{refused}");
        refused.to_string()
    }

    #[tokio::test]
    async fn a_database_that_can_not_be_used_is_told_with_what_to_do() {
        if !is_there() {
            return;
        }
        let database = Database::create().expect("PostgreSQL");
        let (url, name) = (database.url(), database.name());
        let missing = url.replacen(&format!("/{name}?"), "/nothing?", 1);
        let missing = refusal(&missing).await;
        assert!(missing.contains("createdb"), "{missing}");

        let role = format!("role_{name}");
        database.run(&format!(
            "CREATE ROLE {role} LOGIN; REVOKE CREATE ON SCHEMA public FROM public"
        ));
        let (scheme, rest) = url.split_once("://").expect("a URL");
        let (_, place) = rest.split_once('@').unwrap_or(("", rest));
        let weak = refusal(&format!("{scheme}://{role}@{place}")).await;
        assert!(weak.contains(&format!("OWNER TO {role}")), "{weak}");
        let nobody = refusal(&format!("{scheme}://{role}_2@{place}")).await;
        assert!(nobody.contains("correct the user"), "{nobody}");
        database.run(&format!("DROP ROLE {role}"));

        let deaf = refusal("postgres://yoto@127.0.0.1:1/yoto").await;
        assert!(deaf.contains("can't be reached at 127.0.0.1:1"), "{deaf}");
        let file = tempfile::NamedTempFile::new().expect("a file");
        std::fs::write(file.path(), "no certificate").expect("writes");
        let path = file.path().display();
        let divider = if url.contains('?') { '&' } else { '?' };
        let plain = format!("{url}{divider}sslmode=verify-full&sslrootcert={path}");
        let plain = refusal(&plain).await;
        assert!(plain.contains("correct sslmode"), "{plain}");
    }
}
