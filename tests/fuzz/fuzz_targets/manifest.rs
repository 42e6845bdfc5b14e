//! A checkpoint's manifest: what is read survives being written, and each file of refined poses has one name.
#![no_main]

use libfuzzer_sys::fuzz_target;
use yoto_proto::manifest::{Manifest, files};

fuzz_target!(|bytes: &[u8]| {
    let Ok(manifest) = Manifest::from_json(bytes) else {
        return;
    };
    let written = serde_json::to_vec(&manifest).expect("numbers from JSON are finite");
    let mut read = Manifest::from_json(&written).expect("its own text");
    // serde_json may read the last digit of a float otherwise than it was written.
    let difference = (read.job_seconds - manifest.job_seconds).abs();
    assert!(difference <= 1e-12 * manifest.job_seconds.abs());
    read.job_seconds = manifest.job_seconds;
    assert_eq!(read, manifest);
    let largest = manifest.objects.iter().map(|object| object.bytes).max();
    assert!(manifest.bytes() >= largest.unwrap_or_default());
    for object in &manifest.objects {
        let file = &object.file;
        assert_eq!(manifest.object(file).map(|found| &found.file), Some(file));
        if let Some(slot) = files::refined_by(file) {
            assert_eq!(&files::refined_poses(slot), file);
        }
    }
});
