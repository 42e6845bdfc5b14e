//! Which coordinator this is, among several of one database: an id in its data folder.

use crate::error::ServerError;
use std::io::{ErrorKind, Write};
use std::path::Path;
use yoto_process::private;
use yoto_store::new_id;

/// The file in the data folder.
const FILE: &str = "instance";

/// The id of the coordinator in `data_dir`, whose lock the caller has. It is made at the first start.
///
/// # Errors
/// When the file can't be read or written.
pub(crate) fn of(data_dir: &Path) -> Result<String, ServerError> {
    let path = data_dir.join(FILE);
    let failed = |cause| ServerError::DataDir {
        path: path.clone(),
        cause,
    };
    match std::fs::read_to_string(&path) {
        Ok(id) if !id.trim().is_empty() => return Ok(id.trim().to_owned()),
        // A start that was interrupted leaves an empty file.
        Ok(_) => {}
        Err(error) if error.kind() == ErrorKind::NotFound => {}
        Err(error) => return Err(failed(error)),
    }
    let id = new_id();
    let file = private::writable().create(true).truncate(true).open(&path);
    let mut file = file.map_err(failed)?;
    writeln!(file, "{id}")
        .and_then(|()| file.sync_all())
        .map_err(failed)?;
    Ok(id)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_id_stays_and_an_empty_file_gets_one() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join(FILE), "").expect("writes");
        let id = of(folder.path()).expect("makes one");
        assert_eq!(of(folder.path()).expect("reads it"), id);
        let other = tempfile::tempdir().expect("a folder");
        assert_ne!(of(other.path()).expect("makes one"), id);
    }
}
