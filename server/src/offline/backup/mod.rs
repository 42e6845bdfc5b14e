//! Copies of a whole service, and the way back.
//!
//! Rows come first, then objects. An object is written before a row names it, and stays for the time of grace after no row
//! does: objects that are copied after the rows, and within that time, have all that the rows name. So the service may run
//! meanwhile, and what it adds after the copy of the rows is not in the backup.

mod carry;
mod database;
mod folders;

pub use database::PROGRAMS;

use super::erased::{self, ErasedPerson};
use crate::ServerError;
use crate::data_dir::{DATABASE_FILE, DataDirLock, OBJECTS_FOLDER};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;
use thiserror::Error;
use yoto_process::clock::SystemClock;
use yoto_store::{PostgresUrl, Store};

/// The file that a complete backup has, and its text.
const MARKER: (&str, &str) = ("yoto-backup.txt", "yoto backup 1\n");
/// The rows of PostgreSQL in a backup.
const DUMP: &str = "yoto.dump";

/// Where a service has its state.
#[derive(Debug, Clone)]
pub struct Place {
    /// The data folder.
    pub data_dir: PathBuf,
    /// A database of PostgreSQL instead of the file in the data folder.
    pub database: Option<PostgresUrl>,
    /// Whether the objects are in the data folder. Those of another store are not copied.
    pub objects: bool,
}

/// What was copied.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Copied {
    /// Number of objects.
    pub objects: u64,
    /// Their bytes.
    pub bytes: u64,
}

/// What was restored.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Restored {
    /// What was copied.
    pub copied: Copied,
    /// Number of people in the backup whose erasure has begun again.
    pub erased: usize,
}

/// The reason why a backup can't be made or restored.
#[derive(Debug, Error)]
pub enum BackupError {
    /// The folder to write to has something in it.
    #[error("{} is not empty: choose another folder", .0.display())]
    NotEmpty(PathBuf),
    /// The folder to write to is among the objects that are copied.
    #[error("{} is in the service's own {}: a backup there would copy itself, choose a folder elsewhere", .0.display(), .1.display())]
    Inside(PathBuf, PathBuf),
    /// The folder is not a backup.
    #[error("{} is no complete backup: it has no {}", .0.display(), MARKER.0)]
    NoBackup(PathBuf),
    /// The backup has rows of PostgreSQL, and they have nowhere to go.
    #[error("the backup in {} is one of PostgreSQL: name an empty database with --database", .0.display())]
    OtherDatabase(PathBuf),
    /// There is nothing to copy.
    #[error("there is no service's database at {}", .0.display())]
    NoService(PathBuf),
    /// The objects are in another store.
    #[error(
        "{} has no objects: if the service has them in another store (--objects), copy them by its own means, and only the rows by \
         --rows-only", .0.display()
    )]
    NoObjects(PathBuf),
    /// A file or folder fails.
    #[error("{action} {}: {source}", path.display())]
    File {
        /// E.g. "copying".
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The database to restore into has rows.
    #[error("the database has rows in '{table}': name an empty one with --database")]
    RowsThere {
        /// A table.
        table: String,
    },
    /// A column has a type that SQLite's rows are not carried to.
    #[error("the table '{table}' has a column of the type {kind}")]
    Type {
        /// The table.
        table: String,
        /// PostgreSQL's name of the type.
        kind: String,
    },
    /// A database fails.
    #[error("copying the database: {0}")]
    Database(#[from] sqlx::Error),
    /// A program of PostgreSQL fails.
    #[error("{program}: {told}")]
    Program {
        /// Its name.
        program: &'static str,
        /// Its own words.
        told: String,
    },
    /// The data folder is in use.
    #[error(transparent)]
    Server(#[from] ServerError),
}

impl BackupError {
    fn file(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::File {
            action,
            path: path.to_owned(),
            source,
        }
    }
}

/// Copies the state at `from` into the folder `to`, which is created if missing. The service may run.
///
/// # Errors
/// When the folder is not empty, the objects are elsewhere, or something can't be read or written. The folder is no backup then.
pub async fn backup(from: &Place, to: &Path) -> Result<Copied, BackupError> {
    outside(to, &from.data_dir.join(OBJECTS_FOLDER))?;
    make_empty(to)?;
    match &from.database {
        Some(url) => database::dump(url, &to.join(DUMP)).await?,
        None => database::copy(&from.data_dir.join(DATABASE_FILE), &to.join(DATABASE_FILE)).await?,
    }
    let objects = from.data_dir.join(OBJECTS_FOLDER);
    // A service makes this folder at its first start, and never removes it.
    if from.objects && !objects.is_dir() {
        return Err(BackupError::NoObjects(from.data_dir.clone()));
    }
    let copied = match from.objects {
        true => folders::copy(&objects, &to.join(OBJECTS_FOLDER)).await?,
        false => Copied::default(),
    };
    let marker = to.join(MARKER.0);
    std::fs::write(&marker, MARKER.1).map_err(BackupError::file("writing", &marker))?;
    Ok(copied)
}

/// Copies the backup in the folder `from` to `to`, where no service has been: an empty or missing data folder, and an empty
/// database of PostgreSQL, also for rows of SQLite. Of the `erased` people, those who are in the backup are erased again by the first
/// coordinator: their erasures have begun when this returns.
///
/// # Errors
/// When `from` is no complete backup, something is at `to` already, or something can't be read or written.
pub async fn restore(
    from: &Path,
    to: &Place,
    erased: &[ErasedPerson],
) -> Result<Restored, BackupError> {
    let marker = std::fs::read_to_string(from.join(MARKER.0));
    if marker.ok().as_deref() != Some(MARKER.1) {
        return Err(BackupError::NoBackup(from.to_owned()));
    }
    let (dump, file) = (from.join(DUMP), from.join(DATABASE_FILE));
    if to.database.is_none() && dump.exists() {
        return Err(BackupError::OtherDatabase(from.to_owned()));
    }
    make_empty(&to.data_dir)?;
    let _lock = DataDirLock::take(&to.data_dir)?;
    match &to.database {
        Some(url) if dump.exists() => database::undump(url, &dump).await?,
        Some(url) => carry::carry(&file, &to.data_dir, url).await?,
        None => folders::copy_file(&file, &to.data_dir.join(DATABASE_FILE))
            .map(drop)
            .map_err(BackupError::file("copying", &file))?,
    }
    let erased = erase_again(to, erased).await?;
    let copied = match to.objects {
        true => {
            let objects = from.join(OBJECTS_FOLDER);
            folders::copy(&objects, &to.data_dir.join(OBJECTS_FOLDER)).await?
        }
        false => Copied::default(),
    };
    Ok(Restored { copied, erased })
}

/// When the backup in `folder` was made: its marker is written last.
///
/// # Errors
/// When it is no complete backup.
pub fn made_at(folder: &Path) -> Result<SystemTime, BackupError> {
    let marker = folder.join(MARKER.0);
    let written = marker.metadata().and_then(|it| it.modified());
    written.map_err(|_| BackupError::NoBackup(folder.to_owned()))
}

async fn erase_again(to: &Place, people: &[ErasedPerson]) -> Result<usize, BackupError> {
    if people.is_empty() {
        return Ok(0);
    }
    let clock = Arc::new(SystemClock);
    let store = match &to.database {
        Some(url) => Store::open_postgres(url, clock).await,
        None => Store::open_sqlite(&to.data_dir.join(DATABASE_FILE), clock).await,
    };
    let store = store.map_err(ServerError::from)?;
    let begun = erased::erase_again(&store, people).await;
    store.close().await;
    Ok(begun.map_err(ServerError::from)?)
}

/// Checks that the folder `to` is outside of the folder `objects`. Symbolic links are followed, and `to` may not exist yet.
fn outside(to: &Path, objects: &Path) -> Result<(), BackupError> {
    let Ok(objects) = objects.canonicalize() else {
        return Ok(());
    };
    let absolute = std::path::absolute(to).map_err(BackupError::file("finding", to))?;
    let existing = absolute.ancestors().find_map(|it| it.canonicalize().ok());
    match existing {
        Some(place) if place.starts_with(&objects) => {
            Err(BackupError::Inside(to.to_owned(), objects))
        }
        _ => Ok(()),
    }
}

/// Creates `folder`, for this user alone, unless it is there and empty.
fn make_empty(folder: &Path) -> Result<(), BackupError> {
    yoto_process::private::create_dir_all(folder).map_err(BackupError::file("creating", folder))?;
    let mut found = std::fs::read_dir(folder).map_err(BackupError::file("reading", folder))?;
    match found.next() {
        None => Ok(()),
        Some(_) => Err(BackupError::NotEmpty(folder.to_owned())),
    }
}
