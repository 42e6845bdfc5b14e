//! Motions by name.

use crate::gaussians::quaternion;
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::transform::rodrigues;
use yoto_capture::skeleton::{Skeleton, SkeletonError};

/// A motion of a person's skeleton.
#[derive(Clone, Debug, PartialEq)]
pub struct Clip {
    /// What it is called.
    pub name: String,
    /// Frames per second.
    pub fps: f64,
    /// At least one.
    pub poses: Vec<Pose>,
}

impl Clip {
    /// The rest pose of `skeleton`, which does not move.
    pub fn rest(skeleton: &Skeleton) -> Self {
        Self {
            name: "rest".into(),
            fps: 1.0,
            poses: vec![Pose::rest(skeleton.joints())],
        }
    }

    /// Little-endian: of each frame, the root's shift as 3 numbers of 32 bits, metres, then of each joint
    /// the turn as a quaternion of 4 numbers of 16 bits, real part first.
    ///
    /// # Errors
    /// If a pose is not of `skeleton`.
    pub(crate) fn packed(&self, skeleton: &Skeleton) -> Result<Vec<u8>, SkeletonError> {
        let mut bytes = Vec::new();
        for pose in &self.poses {
            skeleton.check_pose(pose)?;
            let shift = pose.translation.iter();
            bytes.extend(shift.flat_map(|value| value.to_le_bytes()));
            for turn in pose.rotations_f64() {
                let numbers = quaternion(&rodrigues(turn));
                let whole = numbers.map(|q| (q * f64::from(i16::MAX)).round() as i16);
                bytes.extend(whole.iter().flat_map(|value| value.to_le_bytes()));
            }
        }
        Ok(bytes)
    }
}
