//! Files that are written whole or not at all.

use std::io;
use std::path::Path;
use tempfile::NamedTempFile;

/// The folder of the file `path`.
pub(crate) fn folder_of(path: &Path) -> &Path {
    let parent = path.parent();
    let named = parent.filter(|folder| !folder.as_os_str().is_empty());
    named.unwrap_or(Path::new("."))
}

/// Moves a file that was written beside `path` to its name.
///
/// # Errors
/// If that fails; the file is removed then.
pub(crate) fn keep(part: NamedTempFile, path: &Path) -> io::Result<()> {
    // Only the owner can read a temporary file; others may read a result as well.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let part = part.as_file();
        part.set_permissions(std::fs::Permissions::from_mode(0o644))?;
    }
    part.persist(path)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_takes_its_name_at_the_end_and_nothing_is_left_without_it() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("film.mp4");
        let part = NamedTempFile::new_in(folder_of(&path)).expect("a file");
        std::fs::write(part.path(), b"whole").expect("writes");
        assert!(!path.exists());
        keep(part, &path).expect("moves");
        assert_eq!(std::fs::read(&path).expect("there"), b"whole");
        let part = NamedTempFile::new_in(dir.path()).expect("a file");
        keep(part, &dir.path().join("missing/film.mp4")).expect_err("no such folder");
        assert_eq!(std::fs::read_dir(dir.path()).expect("a folder").count(), 1);
        assert_eq!(folder_of(Path::new("film.mp4")), Path::new("."));
    }
}
