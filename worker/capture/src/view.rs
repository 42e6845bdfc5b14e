//! One frame through one camera of a capture, without its pictures.

use super::CaptureError;
use super::files::{at_fault, read_file};
use super::held_out::HeldOut;
use crate::camera::Camera;
use crate::skeleton::{Pose, Skeleton};
use std::path::Path;
use yoto_proto::pose_track::{self, PoseTrack};

/// A frame of `poses.json` through one camera.
#[derive(Clone, Debug, PartialEq)]
pub struct CaptureView {
    /// The person's skeleton.
    pub skeleton: Skeleton,
    /// The person's pose.
    pub pose: Pose,
    /// The camera, at the stored images' size.
    pub camera: Camera,
}

impl CaptureView {
    /// Frame number `frame` through the camera called `camera`, which is `train` or a held-out camera.
    /// Only `poses.json` of the folder `dir` is read.
    ///
    /// # Errors
    /// If the file is missing or broken, or has no such frame or camera.
    pub fn read(dir: &Path, camera: &str, frame: u32) -> Result<Self, CaptureError> {
        let bytes = read_file(&dir.join(pose_track::FILE), pose_track::FILE, None)?;
        let track = PoseTrack::from_json(&bytes).map_err(CaptureError::Invalid)?;
        let (pose, camera) = HeldOut::from_json(&bytes)?.find(&track, camera, frame)?;
        let skeleton = Skeleton::from_track(&track.skeleton)
            .map_err(|error| at_fault("skeleton", error.to_string()))?;
        Ok(Self {
            skeleton,
            pose,
            camera,
        })
    }

    /// The pose for a body with the rest joints of `skeleton`, with the root at the capture's position.
    pub fn pose_for(&self, skeleton: &Skeleton) -> Pose {
        let (from, to) = (self.skeleton.root(), skeleton.root());
        let translation =
            std::array::from_fn(|a| (f64::from(self.pose.translation[a]) + from[a] - to[a]) as f32);
        Pose {
            rotations: self.pose.rotations.clone(),
            translation,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::track;

    #[test]
    fn frames_and_cameras_are_found_by_name() {
        let mut poses = serde_json::to_value(track(2, [6, 4])).expect("json");
        let (k, e) = (
            poses["frames"][0]["K"].clone(),
            poses["frames"][0]["E"].clone(),
        );
        let mut near = e.clone();
        near[2][3] = 2.0.into();
        poses["eval"] = serde_json::json!({"cam00": {"K": k, "E": near, "frames": [1]}});
        poses["eval_pose"] = serde_json::json!({
            "frames": [{"index": 9, "pose": [0.1, 0.2, 0.3], "translation": [0.0, 0.0, 1.0]}],
            "cams": {"train": {"K": k, "E": e}}
        });
        let dir = tempfile::tempdir().expect("a folder");
        std::fs::write(dir.path().join("poses.json"), poses.to_string()).expect("writes");
        let depth = |camera: &str, frame: u32| {
            CaptureView::read(dir.path(), camera, frame).map(|view| view.camera.e[2][3])
        };
        assert_eq!(depth("train", 1).expect("trained on"), 3.0);
        assert_eq!(depth("cam00", 0).expect("another camera"), 2.0);
        assert_eq!(depth("train", 9).expect("held out"), 3.0);
        let unseen = CaptureView::read(dir.path(), "cam00", 9).expect("both held out");
        assert_eq!(unseen.pose.translation, [0.0, 0.0, 1.0]);
        let error = depth("cam7", 0).expect_err("no camera").to_string();
        assert!(error.contains("cameras: cam00, train"), "{error}");
        assert!(depth("train", 5).is_err());
    }

    #[test]
    fn the_root_stays_where_it_is_in_the_world() {
        let skeleton = |height: f64| Skeleton {
            names: vec!["root".into()],
            parents: vec![None],
            rest: vec![[0.0, height, 0.0]],
        };
        let mut pose = Pose::rest(1);
        pose.translation = [0.0, 0.25, 0.0];
        let view = CaptureView {
            skeleton: skeleton(1.0),
            pose,
            camera: Camera::look_at([0.0, 0.0, 3.0], [0.0; 3], [0.0, 1.0, 0.0], 4.0, 4, 4),
        };
        assert_eq!(view.pose_for(&skeleton(0.0)).translation, [0.0, 1.25, 0.0]);
    }
}
