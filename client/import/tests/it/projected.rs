//! Where a track says that joints are seen, by the model's own kinematics and camera.

use crate::expected;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;
use yoto_proto::pose_track::PoseTrack;

/// Asserts that the joints of each frame land within `tolerance` pixels of where the script has
/// those of frame `frames[i]`, and that size and lens are the script's.
pub(crate) fn assert_lands(track: &PoseTrack, name: &str, frames: &[usize], tolerance: f64) {
    let expected = expected(name);
    assert_eq!(serde_json::json!(track.image_size), expected["image_size"]);
    let lens: Vec<f64> = serde_json::from_value(expected["distortion"].clone()).expect("five");
    for (found, wanted) in track.distortion.iter().zip(lens) {
        assert!((found - wanted).abs() < 1e-6, "{:?}", track.distortion);
    }
    let indices: Vec<usize> = track.frames.iter().map(|f| f.index as usize).collect();
    assert_eq!(indices, frames, "{name}");
    let skeleton = Skeleton::from_track(&track.skeleton).expect("a skeleton");
    for frame in &track.frames {
        let pose = Pose::from_frame(frame).expect("a pose");
        let camera = Camera::from_frame(frame, track.image_size).expect("a camera");
        let wanted: Vec<[f64; 2]> =
            serde_json::from_value(expected["frames"][frame.index as usize].clone())
                .expect("a pixel a joint");
        assert_eq!(wanted.len(), 24);
        for (joint, (point, [u, v])) in skeleton.posed_joints(&pose).iter().zip(wanted).enumerate()
        {
            // The script counts from the first pixel's centre, the camera from its corner.
            let seen = camera.project(*point).expect("in front of the camera");
            let off = (seen[0] - 0.5 - u).hypot(seen[1] - 0.5 - v);
            assert!(
                off < tolerance,
                "{name} frame {} joint {joint}: {off} px from {u}, {v}",
                frame.index
            );
        }
    }
}
