//! Archives: names that lead outside, bombs, truncated files, files of other formats.

use super::{Case, all_are_rejected, film, with};
use std::io::Write;
use tar::EntryType;

/// A tar of one entry with the raw `name` and `kind`.
fn tar_of(name: &[u8], kind: tar::EntryType) -> anyhow::Result<Vec<u8>> {
    let mut header = tar::Header::new_ustar();
    header.as_mut_bytes()[..name.len()].copy_from_slice(name);
    header.set_entry_type(kind);
    header.set_size(1);
    header.set_cksum();
    let mut builder = tar::Builder::new(Vec::new());
    builder.append(&header, &b"x"[..])?;
    Ok(builder.into_inner()?)
}

/// A zip of one entry called `name`, whose bytes `X` become `instead` afterwards.
fn zip_of(name: &str, instead: u8) -> anyhow::Result<Vec<u8>> {
    let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    writer.start_file(name, zip::write::SimpleFileOptions::default())?;
    writer.write_all(b"x")?;
    let mut bytes = writer.finish()?.into_inner();
    for byte in bytes.iter_mut().filter(|byte| **byte == b'X') {
        *byte = instead;
    }
    Ok(bytes)
}

/// Half a gibibyte of zeros as a zip.
fn zip_bomb() -> anyhow::Result<Vec<u8>> {
    let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let deflated = zip::write::SimpleFileOptions::default()
        .compression_method(zip::CompressionMethod::Deflated);
    writer.start_file("frames/000000.png", deflated)?;
    std::io::copy(
        &mut std::io::Read::take(std::io::repeat(0), 512 << 20),
        &mut writer,
    )?;
    Ok(writer.finish()?.into_inner())
}

/// A tar.gz with the same content.
fn gzip_bomb() -> anyhow::Result<Vec<u8>> {
    let mut header = tar::Header::new_ustar();
    header.set_path("frames/000000.png")?;
    header.set_size(512 << 20);
    header.set_cksum();
    let mut bytes = Vec::new();
    let mut packer = flate2::write::GzEncoder::new(&mut bytes, flate2::Compression::best());
    packer.write_all(header.as_bytes())?;
    std::io::copy(
        &mut std::io::Read::take(std::io::repeat(0), 512 << 20),
        &mut packer,
    )?;
    packer.finish()?;
    Ok(bytes)
}

#[tokio::test(flavor = "multi_thread")]
async fn tricks_and_bombs_are_refused_by_entry() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let good = film(&dir.path().join("good"))?;
    let plain = |name: &[u8]| tar_of(name, EntryType::Regular);
    let tar = |bytes: Vec<u8>| with(&good, "frames.tar", bytes);
    let zip = |bytes: Vec<u8>| with(&good, "frames.zip", bytes);
    let mut twice = plain(b"000000.png")?;
    // Without the two empty blocks that end it.
    twice.truncate(1024);
    twice.extend(plain(b"000000.PNG")?);
    let long = tar_of(&[b'a'; 99], EntryType::Regular)?;
    let cases = vec![
        Case::new(
            "up",
            tar(plain(b"../../poses.json")?),
            "UNSAFE_PATH",
            "frames.tar: ../../poses.json: ",
        ),
        Case::new(
            "absolute",
            tar(plain(b"/etc/passwd")?),
            "UNSAFE_PATH",
            "frames.tar: /etc/passwd: ",
        ),
        Case::new(
            "backslashes",
            tar(plain(b"..\\..\\x.png")?),
            "UNSAFE_PATH",
            "frames.tar: ..\\..\\x.png: ",
        ),
        Case::new(
            "a drive",
            tar(plain(b"C:x.png")?),
            "UNSAFE_PATH",
            "frames.tar: C:x.png: ",
        ),
        Case::new(
            "a link",
            tar(tar_of(b"frames", EntryType::Symlink)?),
            "UNSAFE_PATH",
            "frames.tar: frames: ",
        ),
        Case::new(
            "a hard link",
            tar(tar_of(b"1.png", EntryType::Link)?),
            "UNSAFE_PATH",
            "frames.tar: 1.png: ",
        ),
        Case::new(
            "a device",
            tar(tar_of(b"1.png", EntryType::Char)?),
            "UNSAFE_PATH",
            "frames.tar: 1.png: ",
        ),
        Case::new(
            "no text",
            tar(plain(b"fr\xe4me1.png")?),
            "BAD_NAME",
            "frames.tar: fr",
        ),
        Case::new(
            "control",
            tar(plain(b"1\x07.png")?),
            "BAD_NAME",
            "frames.tar: 1",
        ),
        Case::new("twice", tar(twice), "DUPLICATE", "frames.tar: 000000.PNG: "),
        Case::new(
            "cut",
            tar(long[..700].to_vec()),
            "UNDECODABLE",
            "frames.tar: ",
        ),
        Case::new("empty", tar(Vec::new()), "EMPTY", "frames.tar: "),
        Case::new(
            "zip: up",
            zip(zip_of("../1.png", b'X')?),
            "UNSAFE_PATH",
            "frames.zip: ../1.png: ",
        ),
        Case::new(
            "zip: no text",
            zip(zip_of("frXme1.png", 0xe4)?),
            "BAD_NAME",
            "frames.zip: fr",
        ),
        Case::new(
            "zip: cut",
            zip(zip_of("1.png", b'X')?[..40].to_vec()),
            "UNDECODABLE",
            "frames.zip: ",
        ),
        Case::new(
            "zip: none",
            zip(b"not a zip".to_vec()),
            "UNDECODABLE",
            "frames.zip: ",
        ),
        Case::new("zip: a bomb", zip(zip_bomb()?), "TOO_LARGE", "frames.zip: "),
        Case::new(
            "gzip: a bomb",
            with(&good, "frames.tar.gz", gzip_bomb()?),
            "TOO_LARGE",
            "frames.tar.gz: ",
        ),
        Case::new(
            "a file that is there",
            with(&good, "masks.zip", zip_of("000001.png", b'X')?),
            "DUPLICATE",
            "masks",
        ),
    ];
    all_are_rejected(dir.path(), cases, good).await
}
