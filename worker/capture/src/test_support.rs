//! Captures for the tests of several modules.

use crate::camera::Camera;
use crate::skeleton::Pose;
use yoto_proto::pose_track::{PoseTrack, Skeleton};

/// A valid track of `frames` frames of a single joint.
pub(crate) fn track(frames: u32, image_size: [u32; 2]) -> PoseTrack {
    let [width, height] = image_size;
    let camera = Camera::look_at(
        [0.0, 0.0, 3.0],
        [0.0; 3],
        [0.0, 1.0, 0.0],
        4.0,
        width,
        height,
    );
    PoseTrack {
        skeleton: Skeleton {
            names: vec!["root".into()],
            parents: vec![-1],
            rest_joints: vec![[0.0; 3]],
        },
        image_size,
        fps: 15.0,
        distortion: [0.0; 5],
        frames: (0..frames)
            .map(|index| camera.to_frame(index, &Pose::rest(1)))
            .collect(),
    }
}
