//! Good and hostile archives, made with writer libraries.

use super::*;
use ::zip::ZipWriter;
use ::zip::write::SimpleFileOptions;
use std::io::Cursor;

fn zip(entries: &[(&str, &[u8])]) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in entries {
        let options =
            SimpleFileOptions::default().compression_method(::zip::CompressionMethod::Deflated);
        writer.start_file(*name, options).expect("starts");
        writer.write_all(content).expect("writes");
    }
    writer.finish().expect("ends").into_inner()
}

fn tar(entries: &[(&[u8], ::tar::EntryType, &[u8])]) -> Vec<u8> {
    let mut builder = ::tar::Builder::new(Vec::new());
    for (name, kind, content) in entries {
        let mut header = ::tar::Header::new_ustar();
        header.as_mut_bytes()[..name.len()].copy_from_slice(name);
        header.set_entry_type(*kind);
        header.set_mode(0o644);
        header.set_size(content.len() as u64);
        header.set_cksum();
        builder.append(&header, *content).expect("appends");
    }
    builder.into_inner().expect("ends")
}

fn unpack_with(bytes: &[u8], limits: &Limits) -> Result<Vec<(String, Vec<u8>)>, MediaError> {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("archive");
    std::fs::write(&path, bytes).expect("writes");
    let folder = dir.path().join("x");
    std::fs::create_dir(&folder).expect("creates");
    let files = Unpacker::new(&folder, limits).unpack(&path)?;
    let inside = |path: &Path| path.parent() == Some(folder.as_path());
    assert!(files.values().all(|path| inside(path)), "{files:?}");
    let read = |(name, path): (String, PathBuf)| (name, std::fs::read(path).expect("reads"));
    Ok(files.into_iter().map(read).collect())
}

fn unpack(bytes: &[u8]) -> Result<Vec<(String, Vec<u8>)>, MediaError> {
    unpack_with(bytes, &Limits::default())
}

fn fault(bytes: &[u8], limits: &Limits) -> MediaFault {
    match unpack_with(bytes, limits) {
        Err(MediaError::Bad(fault)) => fault,
        other => panic!("not refused: {other:?}"),
    }
}

const FILE: ::tar::EntryType = ::tar::EntryType::Regular;

#[test]
fn zip_tar_and_gzipped_tar_unpack_alike() {
    let expected = vec![
        ("frames/1.png".to_owned(), b"one".to_vec()),
        ("frames/2.png".to_owned(), b"two".to_vec()),
    ];
    let zipped = zip(&[
        ("frames/2.png", b"two"),
        ("__MACOSX/frames/._2.png", b"litter"),
        ("frames/1.png", b"one"),
    ]);
    assert_eq!(unpack(&zipped).expect("unpacks"), expected);
    let tarred = tar(&[
        (b"frames/", ::tar::EntryType::Directory, b""),
        (b"./frames/1.png", FILE, b"one"),
        (b"frames/2.png", FILE, b"two"),
    ]);
    assert_eq!(unpack(&tarred).expect("unpacks"), expected);
    let mut gzipped = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    gzipped.write_all(&tarred).expect("writes");
    assert_eq!(
        unpack(&gzipped.finish().expect("ends")).expect("unpacks"),
        expected
    );
}

#[test]
fn paths_that_lead_outside_links_and_twins_are_refused_with_their_name() {
    let limits = Limits::default();
    for (bytes, code, field) in [
        (
            zip(&[("../poses.json", b"")]),
            "UNSAFE_PATH",
            "../poses.json",
        ),
        (zip(&[("/etc/passwd", b"")]), "UNSAFE_PATH", "/etc/passwd"),
        (
            tar(&[(b"a/../../b", FILE, b"")]),
            "UNSAFE_PATH",
            "a/../../b",
        ),
        (
            tar(&[(b"m\xe4sk.png", FILE, b"")]),
            "BAD_NAME",
            "m\u{fffd}sk.png",
        ),
        (
            tar(&[(b"a", ::tar::EntryType::Symlink, b"")]),
            "UNSAFE_PATH",
            "a",
        ),
        (
            tar(&[(b"a", ::tar::EntryType::Link, b"")]),
            "UNSAFE_PATH",
            "a",
        ),
        (
            tar(&[(b"a", FILE, b"1"), (b"./A", FILE, b"2")]),
            "DUPLICATE",
            "A",
        ),
        (zip(&[("a", b"1"), ("A", b"2")]), "DUPLICATE", "A"),
    ] {
        let found = fault(&bytes, &limits);
        assert_eq!((found.code, found.field.as_str()), (code, field), "{found}");
    }
    // The writer refuses twins, so one is made by renaming.
    let mut twins = zip(&[("aa", b"1"), ("ab", b"2")]);
    while let Some(at) = twins.windows(2).position(|w| w == b"ab") {
        twins[at + 1] = b'a';
    }
    assert_eq!(fault(&twins, &limits).code, "DUPLICATE");
}

#[test]
fn a_symbolic_link_in_a_zip_is_refused() {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    writer
        .add_symlink("frames", "/etc", SimpleFileOptions::default())
        .expect("adds");
    let bytes = writer.finish().expect("ends").into_inner();
    assert_eq!(fault(&bytes, &Limits::default()).code, "UNSAFE_PATH");
}

#[test]
fn bombs_are_refused_before_they_fill_the_disk() {
    let zeros = vec![0; 3 << 20];
    let bomb = zip(&[("a", &zeros)]);
    assert!(unpack(&bomb).is_ok(), "small enough as such");
    let tight = Limits {
        unpacked_bytes: 1 << 20,
        ..Limits::default()
    };
    assert_eq!(fault(&bomb, &tight).code, "TOO_LARGE");
    // The same with a lie about its size, in both headers.
    let mut lie = bomb.clone();
    let size = (3u32 << 20).to_le_bytes();
    while let Some(at) = lie.windows(4).position(|w| w == size) {
        lie[at..at + 4].copy_from_slice(&10u32.to_le_bytes());
    }
    assert!(matches!(
        fault(&lie, &tight).code,
        "TOO_LARGE" | "UNDECODABLE"
    ));
    let mut gzipped = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    gzipped
        .write_all(&tar(&[(b"a", FILE, &zeros)]))
        .expect("writes");
    let gzipped = gzipped.finish().expect("ends");
    assert_eq!(fault(&gzipped, &tight).code, "TOO_LARGE");
    let few = Limits {
        entries: 2,
        ..Limits::default()
    };
    let many = zip(&[("a", b""), ("b", b""), ("c", b"")]);
    assert_eq!(fault(&many, &few).code, "TOO_LARGE");
}

#[test]
fn no_cut_or_flipped_archive_panics_or_passes_a_cut_entry() {
    let limits = Limits::default();
    let archives = [
        zip(&[("frames/1.png", b"content one"), ("frames/2.png", b"two")]),
        tar(&[(b"frames/1.png", FILE, b"content one")]),
    ];
    for bytes in &archives {
        for length in 0..bytes.len().min(600) {
            let cut = unpack_with(&bytes[..length], &limits);
            let whole = |files: &[(String, Vec<u8>)]| files.iter().all(|(_, c)| c != b"content");
            assert!(
                cut.is_err() || cut.is_ok_and(|files| whole(&files)),
                "{length}"
            );
        }
        for at in 0..bytes.len().min(1024) {
            let mut flipped = bytes.clone();
            flipped[at] ^= 1 << (at % 8);
            // Either answer is valid.
            let _ = unpack_with(&flipped, &limits);
        }
    }
}
