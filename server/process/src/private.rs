//! Creates folders and files that only the service's user can access, whatever the umask: they hold films of people.

use std::fs::{DirBuilder, Metadata, OpenOptions};
use std::io;
use std::path::Path;

/// Creates `folder` and its missing parents with mode 0700. Existing folders keep their mode.
///
/// # Errors
/// When a folder can't be created.
pub fn create_dir_all(folder: &Path) -> io::Result<()> {
    let mut builder = DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(folder)
}

/// Options to open a file for writing. A file that they create has mode 0600.
pub fn writable() -> OpenOptions {
    let mut options = OpenOptions::new();
    options.write(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options
}

/// Whether other users of the machine have access to `folder`. Always false except on Unix.
///
/// # Errors
/// When its metadata can't be read.
pub fn is_open_to_others(folder: &Path) -> io::Result<bool> {
    std::fs::metadata(folder).map(|it| grants_others(&it))
}

#[cfg(unix)]
fn grants_others(meta: &Metadata) -> bool {
    std::os::unix::fs::MetadataExt::mode(meta) & 0o077 != 0
}

#[cfg(not(unix))]
fn grants_others(_: &Metadata) -> bool {
    false
}
