//! An archive: its files under numbers in one folder, or a fault, within the limits.
#![no_main]

use libfuzzer_sys::fuzz_target;
use yoto_media::Limits;
use yoto_media::archive::Unpacker;

fuzz_target!(|bytes: &[u8]| {
    let limits = Limits {
        entries: 64,
        unpacked_bytes: 1 << 20,
        ..Limits::default()
    };
    let Ok(dir) = tempfile::tempdir() else { return };
    let (path, folder) = (dir.path().join("a"), dir.path().join("x"));
    if std::fs::write(&path, bytes).and_then(|()| std::fs::create_dir(&folder)).is_err() {
        return;
    }
    if let Ok(files) = Unpacker::new(&folder, &limits).unpack(&path) {
        let mut total = 0;
        for file in files.values() {
            assert_eq!(file.parent(), Some(folder.as_path()));
            total += std::fs::metadata(file).map_or(0, |meta| meta.len());
        }
        assert!(total <= limits.unpacked_bytes && files.len() <= limits.entries);
    }
});
