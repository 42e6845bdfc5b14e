//! A file of HDF5 as the importer of PeopleSnapshot reads it: arrays of their declared shapes, or a fault.
#![no_main]

// The importer's reader is private, so it is a module here, beside what it uses of the importer.
#[allow(dead_code)]
#[path = "../../../client/import/src/source/hdf5.rs"]
mod hdf5;

use hdf5::Hdf5;
use libfuzzer_sys::fuzz_target;
use std::path::{Path, PathBuf};

/// The importer's error: what is wrong.
#[derive(Debug)]
pub struct ImportError(String);

/// The importer's folder, with one file.
pub struct Source(PathBuf);

impl Source {
    fn has(&self, _: &str) -> bool {
        true
    }

    fn path(&self, _: &str) -> &Path {
        &self.0
    }

    fn fault(
        &self,
        _: &str,
        _: &str,
        _: Option<u32>,
        _: &str,
        message: impl Into<String>,
    ) -> ImportError {
        ImportError(message.into())
    }
}

fuzz_target!(|bytes: &[u8]| {
    let Ok(file) = tempfile::NamedTempFile::new() else {
        return;
    };
    if std::fs::write(file.path(), bytes).is_err() {
        return;
    }
    let source = Source(file.path().to_owned());
    let open = match Hdf5::open(&source, "file") {
        Ok(open) => open,
        Err(ImportError(message)) => return assert!(!message.is_empty()),
    };
    if let Ok((shape, values)) = open.unchecked("pose") {
        assert_eq!(shape.iter().product::<u64>(), values.len() as u64);
    }
    let _ = open.unchecked_rows::<3>("trans");
    if let Ok((_, betas)) = open.numbers("betas") {
        assert!(betas.iter().all(|value| value.is_finite()));
    }
    if let Ok(masks) = open.stack("masks") {
        let [width, height] = masks.size().map(|side| side as usize);
        for at in 0..masks.frames().min(4) {
            if let Ok(mask) = masks.read(at) {
                assert_eq!(mask.len(), width * height);
                assert!(mask.iter().all(|it| matches!(it, 0 | 255)));
            }
        }
    }
});
