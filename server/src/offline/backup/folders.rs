//! Objects: copies of folders of files.

use super::{BackupError, Copied};
use std::fs::File;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use yoto_process::private;

/// A mark in the names of files that the object store has not finished writing.
const UNFINISHED: char = '#';

/// Copies the folder `from` to `to`. A missing one has no files.
pub(super) async fn copy(from: &Path, to: &Path) -> Result<Copied, BackupError> {
    let (from, to) = (from.to_owned(), to.to_owned());
    let copied = tokio::task::spawn_blocking(move || copy_all(&from, &to)).await;
    copied.unwrap_or_else(|error| {
        Err(BackupError::File {
            action: "copying",
            path: PathBuf::new(),
            source: io::Error::other(error),
        })
    })
}

fn copy_all(from: &Path, to: &Path) -> Result<Copied, BackupError> {
    let mut copied = Copied::default();
    let mut folders = vec![(from.to_owned(), to.to_owned())];
    while let Some((from, to)) = folders.pop() {
        private::create_dir_all(&to).map_err(BackupError::file("creating", &to))?;
        let entries = match std::fs::read_dir(&from) {
            // A running service removes folders of garbage.
            Err(error) if error.kind() == ErrorKind::NotFound => continue,
            entries => entries.map_err(BackupError::file("reading", &from))?,
        };
        for entry in entries {
            let entry = entry.map_err(BackupError::file("reading", &from))?;
            let (source, target) = (entry.path(), to.join(entry.file_name()));
            let kind = entry.file_type();
            if kind
                .map_err(BackupError::file("reading", &source))?
                .is_dir()
            {
                folders.push((source, target));
                continue;
            }
            if entry.file_name().to_string_lossy().contains(UNFINISHED) {
                continue;
            }
            match copy_file(&source, &target) {
                Ok(bytes) => {
                    copied.objects += 1;
                    copied.bytes += bytes;
                }
                Err(error) if error.kind() == ErrorKind::NotFound => {}
                Err(error) => return Err(BackupError::file("copying", &source)(error)),
            }
        }
    }
    Ok(copied)
}

/// Copies one file, for this user alone; its bytes.
pub(super) fn copy_file(from: &Path, to: &Path) -> io::Result<u64> {
    let mut source = File::open(from)?;
    let mut target = private::writable().create_new(true).open(to)?;
    let bytes = io::copy(&mut source, &mut target)?;
    target.sync_all()?;
    Ok(bytes)
}
