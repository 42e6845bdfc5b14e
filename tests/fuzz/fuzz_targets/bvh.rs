//! A BVH file: a tree whose parents come first and rows of equal length, or an error with a line.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let text = String::from_utf8_lossy(bytes);
    match yoto_formats::bvh::read(&text) {
        Ok(bvh) => {
            for (at, joint) in bvh.joints.iter().enumerate() {
                assert_eq!(joint.parent.is_none(), at == 0);
                assert!(joint.parent.is_none_or(|parent| parent < at));
            }
            let channels: usize = bvh.joints.iter().map(|joint| joint.channels.len()).sum();
            assert!(bvh.frames.iter().all(|row| row.len() == channels));
        }
        Err(error) => assert!(error.line >= 1),
    }
});
