//! The folders of a local store that are kept or deleted as a whole, with their sizes.

use super::disk::{ObjectDisk, failed};
use std::fs::{self, DirEntry};
use std::io::{self, ErrorKind};
use std::path::Path;
use yoto_objects::ObjectsError;
use yoto_proto::keys;

/// A folder of the object store ([`keys::FolderOwner`]).
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Folder {
    /// Its key.
    pub key: String,
    /// Number of files in it, including incomplete ones.
    pub files: u64,
    /// Their bytes.
    pub bytes: u64,
}

impl ObjectDisk {
    /// All folders in the file system. Unlike a list of objects, this includes the remains of a writer that was
    /// killed, and empty folders.
    ///
    /// # Errors
    /// When a folder can't be read.
    pub(crate) async fn folders(&self) -> Result<Vec<Folder>, ObjectsError> {
        let root = self.root.clone();
        let walked = tokio::task::spawn_blocking(move || {
            let mut found = Vec::new();
            for (name, depth) in keys::ROOTS {
                collect(&root.join(name), (*name).to_owned(), *depth, &mut found)?;
            }
            Ok(found)
        });
        let walked = walked
            .await
            .unwrap_or_else(|error| Err(io::Error::other(error)));
        walked.map_err(|error| failed("listing", &self.root, error))
    }
}

/// Appends the folders that are `depth` levels below `folder`.
fn collect(folder: &Path, key: String, depth: usize, found: &mut Vec<Folder>) -> io::Result<()> {
    if depth == 0 {
        let (files, bytes) = size(folder)?;
        found.push(Folder { key, files, bytes });
        return Ok(());
    }
    for entry in entries(folder)? {
        // Keys are ASCII, so a name that is not UTF-8 is no key.
        if let (true, Some(name)) = (is_folder(&entry)?, entry.file_name().to_str()) {
            collect(&entry.path(), format!("{key}/{name}"), depth - 1, found)?;
        }
    }
    Ok(())
}

/// Number and bytes of the files below `folder`.
fn size(folder: &Path) -> io::Result<(u64, u64)> {
    let (mut files, mut bytes) = (0, 0);
    for entry in entries(folder)? {
        let (more, larger) = if is_folder(&entry)? {
            size(&entry.path())?
        } else {
            (1, gone(entry.metadata())?.map_or(0, |it| it.len()))
        };
        files += more;
        bytes += larger;
    }
    Ok((files, bytes))
}

/// The entries of a folder; empty if the folder is gone.
fn entries(folder: &Path) -> io::Result<Vec<DirEntry>> {
    gone(fs::read_dir(folder))?.map_or(Ok(Vec::new()), Iterator::collect)
}

/// Whether the entry is a folder, and not a link to one.
fn is_folder(entry: &DirEntry) -> io::Result<bool> {
    Ok(gone(entry.file_type())?.is_some_and(|kind| kind.is_dir()))
}

/// `None` for what was removed meanwhile.
fn gone<T>(result: io::Result<T>) -> io::Result<Option<T>> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}
