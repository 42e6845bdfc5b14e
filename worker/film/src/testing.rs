//! A small capture for tests.

use yoto_proto::pose_track::{Frame, PoseTrack, Skeleton};

/// Frames 5 to 8 of a two-joint body, seen by a camera in front of it that stands
/// upright in a y-up world.
pub(crate) fn track() -> PoseTrack {
    let frame = |i: u32| Frame {
        index: 5 + i,
        pose: vec![0.0, 0.1 * f64::from(i), 0.0, 0.3, 0.0, 0.0],
        translation: [0.2, 0.1, 0.3 + 0.1 * f64::from(i)],
        k: [[80.0, 0.0, 32.0], [0.0, 80.0, 24.0], [0.0, 0.0, 1.0]],
        e: [
            [1.0, 0.0, 0.0, 0.1],
            [0.0, -1.0, 0.0, 1.2],
            [0.0, 0.0, -1.0, 3.0],
            [0.0, 0.0, 0.0, 1.0],
        ],
    };
    PoseTrack {
        skeleton: Skeleton {
            names: vec!["root".into(), "tip".into()],
            parents: vec![-1, 0],
            rest_joints: vec![[0.0, 0.9, 0.0], [0.0, 0.1, 0.0]],
        },
        image_size: [64, 48],
        fps: 15.0,
        distortion: [0.0; 5],
        frames: (0..4).map(frame).collect(),
    }
}
