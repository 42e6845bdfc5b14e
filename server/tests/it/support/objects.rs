//! The object store of a service under test: a folder, or S3 in a second run of all tests.

use super::Service;
use std::path::{Path, PathBuf};
use url::Url;
use yoto_test_s3::BUCKET;

/// The variable that makes all services of this process keep their objects in S3, with the folder in which the server
/// has them. The server is that of the process that started this one.
pub(crate) const ON_S3: &str = "YOTO_TEST_ON_S3";

/// The URL for the configuration of a service in `folder`; none for objects in that folder.
pub(super) fn url(folder: &Path) -> Option<Url> {
    std::env::var_os(ON_S3)?;
    let name = folder.file_name().expect("has a name").to_string_lossy();
    let prefix = name.trim_start_matches('.');
    Some(Url::parse(&format!("s3://{BUCKET}/{prefix}")).expect("a URL"))
}

impl Service {
    /// Whether the object store has this file or folder.
    pub(crate) fn has(&self, key: &str) -> bool {
        let path = self.path(key);
        // A server for S3 may leave folders that are empty, which are nothing there.
        path.is_file()
            || (path.is_dir() && (std::env::var_os(ON_S3).is_none() || !files(path).is_empty()))
    }

    /// Where the object store has `key`.
    pub(crate) fn path(&self, key: &str) -> PathBuf {
        self.root().join(key)
    }

    /// Every file below the object store's root, but the one that names the store.
    pub(crate) fn stored_files(&self) -> Vec<PathBuf> {
        files(self.root())
    }

    fn root(&self) -> PathBuf {
        let url = self.coordinator.objects_url();
        match std::env::var_os(ON_S3) {
            Some(folder) => Path::new(&folder).join(url.path().trim_start_matches('/')),
            None => url.to_file_path().expect("a local store"),
        }
    }
}

/// The files below a folder but the name of the store; none if it is missing.
fn files(root: PathBuf) -> Vec<PathBuf> {
    let (mut files, mut folders) = (Vec::new(), vec![root]);
    while let Some(folder) = folders.pop() {
        let Ok(entries) = std::fs::read_dir(folder) else {
            continue;
        };
        for entry in entries {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path)
            } else if path.file_name().is_some_and(|it| it != "yoto-store") {
                files.push(path)
            }
        }
    }
    files
}
