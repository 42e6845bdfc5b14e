//! Rows: of SQLite by a copy of its own, of PostgreSQL by its own programs.

use super::BackupError;
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{ConnectOptions, Connection};
use std::io::ErrorKind;
use std::path::Path;
use tokio::process::Command;
use yoto_process::private;
use yoto_store::PostgresUrl;

/// Programs of PostgreSQL that a backup and its restoration need, of the server's version or a later one.
pub const PROGRAMS: [&str; 2] = ["pg_dump", "pg_restore"];

/// Copies the file of SQLite at `from`, as of one transaction; another process may write to it.
pub(super) async fn copy(from: &Path, to: &Path) -> Result<(), BackupError> {
    if !from.is_file() {
        return Err(BackupError::NoService(from.to_owned()));
    }
    // SQLite writes into an existing empty file and keeps its mode.
    let made = private::writable().create_new(true).open(to);
    made.map_err(BackupError::file("creating", to))?;
    let options = SqliteConnectOptions::new().filename(from).read_only(true);
    let mut connection = options.connect().await?;
    sqlx::query("VACUUM INTO $1")
        .bind(to.to_string_lossy().into_owned())
        .execute(&mut connection)
        .await?;
    connection.close().await?;
    let copied = std::fs::File::open(to).and_then(|it| it.sync_all());
    copied.map_err(BackupError::file("writing", to))
}

/// Writes the database at `url` into the file `to`, as of one transaction.
pub(super) async fn dump(url: &PostgresUrl, to: &Path) -> Result<(), BackupError> {
    let mut command = program(PROGRAMS[0], url);
    command
        .args(["--format=custom", "--no-owner", "--file"])
        .arg(to);
    run(PROGRAMS[0], command).await
}

/// Writes the rows of the file `from` into the empty database at `url`, all or none.
pub(super) async fn undump(url: &PostgresUrl, from: &Path) -> Result<(), BackupError> {
    let mut command = program(PROGRAMS[1], url);
    let options = ["--no-owner", "--exit-on-error", "--single-transaction"];
    command.args(options).arg(from);
    run(PROGRAMS[1], command).await
}

/// The program with its database. The password is no argument, which other users could see.
fn program(name: &str, url: &PostgresUrl) -> Command {
    let mut command = Command::new(name);
    let (address, password) = url.for_programs();
    command.arg("--dbname").arg(address);
    if let Some(password) = password {
        command.env("PGPASSWORD", password);
    }
    command
}

async fn run(program: &'static str, mut command: Command) -> Result<(), BackupError> {
    let failed = |told: String| BackupError::Program { program, told };
    let ended = command.kill_on_drop(true).output().await;
    let ended = ended.map_err(|error| match error.kind() {
        ErrorKind::NotFound => failed(
            "not found: install PostgreSQL's client programs, of the server's version or a later one"
                .to_owned(),
        ),
        _ => failed(error.to_string()),
    })?;
    match ended.status.success() {
        true => Ok(()),
        false => Err(failed(
            String::from_utf8_lossy(&ended.stderr).trim().to_owned(),
        )),
    }
}
