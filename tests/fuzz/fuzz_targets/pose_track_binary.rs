//! A pose track in protocol buffers: as `pose_track_json`.
#![no_main]

use libfuzzer_sys::fuzz_target;
use yoto_proto::pose_track::PoseTrack;

fuzz_target!(|bytes: &[u8]| {
    match PoseTrack::from_binary(bytes) {
        Ok(track) => {
            assert!(track.check().is_empty());
            assert_eq!(PoseTrack::from_binary(&track.to_binary()), Ok(track));
        }
        Err(violations) => assert!(!violations.is_empty()),
    }
});
