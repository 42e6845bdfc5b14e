//! Folders and files that only the service's user can read: they hold films of people. The umask decides nothing.

use std::fs::{DirBuilder, Metadata, OpenOptions};
use std::io;
use std::path::Path;

/// Creates `folder` and missing folders above it. One that exists keeps its mode.
///
/// # Errors
/// When the disk refuses.
pub fn create_dir_all(folder: &Path) -> io::Result<()> {
    let mut builder = DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(folder)
}

/// Options that open a file for writes; one that they create is private.
pub fn writable() -> OpenOptions {
    let mut options = OpenOptions::new();
    options.write(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options
}

/// Whether other users of the machine can look into `folder`. Only Unix says so.
///
/// # Errors
/// When it can't be read.
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
