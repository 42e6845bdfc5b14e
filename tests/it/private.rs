//! Only their own user can read the files of `yoto serve` and its worker.
#![cfg(unix)]

use anyhow::{Context, ensure};
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use yoto_synthetic::SyntheticPerson;
use yoto_tests::people::write_capture;
use yoto_tests::process::{Service, succeed};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");

/// Checks that all files and folders below `folder` are private; returns the number of files.
fn private(folder: &Path) -> anyhow::Result<usize> {
    let mut files = 0;
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let meta = fs::symlink_metadata(&path)?;
        let mode = meta.mode();
        ensure!(mode & 0o077 == 0, "{} has {mode:o}", path.display());
        files += if meta.is_dir() { private(&path)? } else { 1 };
    }
    Ok(files)
}

#[test]
fn what_a_service_stores_is_its_user_s_alone() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let (capture, data) = (dir.path().join("ada"), dir.path().join("data"));
    write_capture(&SyntheticPerson::cast(1, 7)[0], 4, 48, &capture)?;
    let service = Service::start(YOTO, &data, true)?;
    let capture = capture.to_str().context("a path")?;
    let add = ["subject", "add", "ada", capture, "--server"];
    succeed(YOTO, &[&add[..], &[service.address.as_str()]].concat())?;
    let shards = private(&data.join("objects/captures"))?;
    ensure!(shards > 0, "a worker has stored the shard");
    ensure!(private(&data)? > shards);
    ensure!(fs::metadata(&data)?.mode() & 0o077 == 0);
    Ok(())
}
