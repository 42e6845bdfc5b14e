//! Errors of the command line before an upload.

use super::{YOTO, pictures};
use anyhow::{Context, ensure};
use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use yoto_tests::process::{Service, fail};

#[test]
fn names_that_are_no_text_and_captures_that_are_none_are_named() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let ada = dir.path().join("ada");
    pictures(&ada)?;
    let service = Service::start(YOTO, &dir.path().join("data"), false)?;
    let path = ada.to_str().context("a plain path")?;
    let add = |more: &[&str]| {
        let mut words = vec!["subject", "add", "ada", "--server", &service.address];
        words.extend(more);
        fail(YOTO, &words)
    };
    let odd = ada
        .join("frames")
        .join(OsStr::from_bytes(b"fr\xe4me 1.png"));
    std::fs::rename(ada.join("frames/000001.png"), &odd)?;
    let said = add(&[path])?;
    ensure!(
        said.contains("frames/fr\u{fffd}me 1.png: the name"),
        "{said}"
    );
    std::fs::remove_file(&odd)?;
    let said = add(&[path])?;
    ensure!(
        said.contains("frames/000001.png frame 1: there is no such"),
        "{said}"
    );

    std::fs::write(
        ada.join("media.json"),
        "{\"correction\": {\"units\": \"inch\"}}",
    )?;
    let said = add(&[path])?;
    ensure!(said.contains("media.json: line 1 column"), "{said}");
    std::fs::remove_file(ada.join("media.json"))?;
    let said = add(&[path, "--masks", "alpha", "--mask-shift", "1"])?;
    ensure!(
        said.contains("media.json: correction.mask_shift: "),
        "{said}"
    );
    let said = add(&[path, "--masks", "elsewhere"])?;
    ensure!(
        said.contains("media.json: masks: nothing exists at 'elsewhere'"),
        "{said}"
    );
    let said = add(&[path, "--frames", "video"])?;
    ensure!(said.contains("media.json: images: "), "{said}");

    let poses = ada.join("poses.json");
    let said = add(&[poses.to_str().context("a plain path")?])?;
    ensure!(said.contains("is a file; a capture is a folder"), "{said}");
    let said = add(&["/nowhere/at/all"])?;
    ensure!(said.contains("/nowhere/at/all"), "{said}");
    Ok(())
}
