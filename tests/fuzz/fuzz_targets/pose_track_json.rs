//! A pose track as JSON: read and checked, or refused with at least one reason; what passes
//! survives being written again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use yoto_proto::pose_track::PoseTrack;

fuzz_target!(|bytes: &[u8]| {
    match PoseTrack::from_json(bytes) {
        Ok(track) => {
            let binary = track.to_binary();
            assert_eq!(PoseTrack::from_binary(&binary), Ok(track));
        }
        Err(violations) => assert!(!violations.is_empty()),
    }
});
