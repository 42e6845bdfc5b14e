//! One coordinator per data folder.
//!
//! Two of them on one SQLite file would each act as the only writer and the only reaper. The
//! operating system drops the lock whenever the process ends.

use crate::error::ServerError;
use std::fs::{File, TryLockError};
use std::path::Path;
use yoto_process::private;

/// Holds the lock of a data folder until it is dropped or released.
#[derive(Debug)]
pub(crate) struct DataDirLock(File);

impl DataDirLock {
    /// Takes the lock of `data_dir`, an existing folder.
    ///
    /// # Errors
    /// [`ServerError::DataDirInUse`] when another coordinator has it.
    pub(crate) fn take(data_dir: &Path) -> Result<Self, ServerError> {
        let path = data_dir.join("lock");
        let file = private::writable()
            .create(true)
            .truncate(false)
            .open(&path)
            .map_err(|cause| ServerError::DataDir {
                path: path.clone(),
                cause,
            })?;
        match file.try_lock() {
            Ok(()) => Ok(Self(file)),
            Err(TryLockError::WouldBlock) => Err(ServerError::DataDirInUse {
                path: data_dir.to_owned(),
            }),
            Err(TryLockError::Error(cause)) => Err(ServerError::DataDir { path, cause }),
        }
    }

    /// Unlocks the folder while other owners of this value may remain.
    pub(crate) fn release(&self) {
        if let Err(error) = self.0.unlock() {
            tracing::warn!(%error, "could not release the data folder's lock");
        }
    }
}

/// A process that another thread starts has a copy of the file until it runs its program, and would keep the lock for that time.
impl Drop for DataDirLock {
    fn drop(&mut self) {
        self.release();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_copy_of_the_file_in_another_process_does_not_keep_the_lock() {
        let folder = tempfile::tempdir().expect("a folder");
        let lock = DataDirLock::take(folder.path()).expect("is free");
        let copy = lock.0.try_clone().expect("copies");
        let taken = DataDirLock::take(folder.path());
        assert!(matches!(taken, Err(ServerError::DataDirInUse { .. })));
        drop(lock);
        DataDirLock::take(folder.path()).expect("is free again");
        drop(copy);
    }
}
