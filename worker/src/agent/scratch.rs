//! A worker's own folder for the files of its jobs. It goes with the worker, or with the start of the next one if the worker
//! was killed.

use std::fs::{File, TryLockError};
use std::io;
use std::path::Path;
use tempfile::TempDir;

/// How names of workers' folders begin.
const PREFIX: &str = "yoto-worker-";

/// The folder, locked as long as this value lives.
#[derive(Debug)]
pub(super) struct Scratch {
    folder: TempDir,
    _lock: File,
}

impl Scratch {
    /// Makes a folder in `parent`, and removes those of workers that are gone.
    ///
    /// # Errors
    /// When `parent` can't be written.
    pub(super) fn make(parent: &Path) -> io::Result<Self> {
        std::fs::create_dir_all(parent)?;
        remove_abandoned(parent)?;
        loop {
            let folder = tempfile::Builder::new().prefix(PREFIX).tempdir_in(parent)?;
            let lock = File::open(folder.path())?;
            // Another worker that starts may have taken it for abandoned before it was locked.
            match lock.try_lock() {
                Ok(()) if folder.path().exists() => {
                    return Ok(Self {
                        folder,
                        _lock: lock,
                    });
                }
                Ok(()) | Err(TryLockError::WouldBlock) => {}
                Err(TryLockError::Error(error)) => return Err(error),
            }
        }
    }

    /// Where it is.
    pub(super) fn path(&self) -> &Path {
        self.folder.path()
    }
}

/// Removes the folders in `parent` of workers that are gone. The system frees their locks, even those of a killed one.
fn remove_abandoned(parent: &Path) -> io::Result<()> {
    for entry in std::fs::read_dir(parent)? {
        let entry = entry?;
        if !entry.file_name().to_string_lossy().starts_with(PREFIX) {
            continue;
        }
        let path = entry.path();
        // Another worker may remove it at the same time, and one of another user is not ours to remove.
        let Ok(lock) = File::open(&path) else {
            continue;
        };
        if lock.try_lock().is_ok() {
            match std::fs::remove_dir_all(&path) {
                Ok(()) => tracing::info!(path = %path.display(), "files of a lost worker removed"),
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) => {
                    tracing::warn!(path = %path.display(), %error, "could not remove the files of a lost worker");
                }
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_folder_of_a_killed_worker_goes_and_that_of_a_running_one_stays() {
        let parent = tempfile::tempdir().expect("a folder");
        let running = Scratch::make(parent.path()).expect("makes a folder");
        // Without a lock, as a killed worker leaves it.
        let killed = parent.path().join(format!("{PREFIX}killed"));
        std::fs::create_dir(&killed).expect("makes a folder");
        std::fs::write(killed.join("upload-000000"), b"half").expect("writes");
        let foreign = parent.path().join("notes");
        std::fs::create_dir(&foreign).expect("makes a folder");
        let next = Scratch::make(parent.path()).expect("makes a folder");
        assert!(running.path().exists() && foreign.exists() && !killed.exists());
        let path = next.path().to_owned();
        drop(next);
        assert!(!path.exists());
    }
}
