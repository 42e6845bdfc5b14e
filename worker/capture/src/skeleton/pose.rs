//! Poses of bodies, from a request, a pose track or a motion.

use super::Vec3;
use crate::view_error::{ViewError, finite, fixed};
use serde::{Deserialize, Serialize};
use yoto_proto::{pose_track, v1};

/// A body's pose, from which a [`super::Skeleton`] computes joint transforms.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// `[K, 3]` axis-angle, radians, local to the parent; the root's first.
    pub rotations: Vec<[f32; 3]>,
    /// Translation of the root joint from its rest position, metres.
    pub translation: [f32; 3],
}

impl Pose {
    /// The rest pose of `joints` joints: all rotations are zero.
    pub fn rest(joints: usize) -> Self {
        Self {
            rotations: vec![[0.0; 3]; joints],
            translation: [0.0; 3],
        }
    }

    /// The pose of a request.
    ///
    /// # Errors
    /// A number of rotation values that is not a multiple of 3, a translation without 3 values, or a value
    /// that is not a number or out of range.
    pub fn from_proto(pose: &v1::BodyPose) -> Result<Self, ViewError> {
        let rotations: Vec<f64> = pose.rotations.iter().map(|&v| f64::from(v)).collect();
        let translation: Vec<f64> = pose.translation.iter().map(|&v| f64::from(v)).collect();
        Self::from_parts(
            "pose.rotations",
            &rotations,
            fixed("pose.translation", &translation)?,
        )
    }

    /// The message that [`Pose::from_proto`] reads back.
    pub fn to_proto(&self) -> v1::BodyPose {
        v1::BodyPose {
            rotations: self.rotations.as_flattened().to_vec(),
            translation: self.translation.to_vec(),
        }
    }

    /// The pose of a pose-track frame.
    ///
    /// # Errors
    /// The same errors as [`Pose::from_proto`].
    pub fn from_frame(frame: &pose_track::Frame) -> Result<Self, ViewError> {
        Self::from_parts("pose", &frame.pose, frame.translation)
    }

    /// A pose from `3 K` axis-angle numbers and a translation; `field` names the former in
    /// errors.
    ///
    /// # Errors
    /// The same errors as [`Pose::from_proto`].
    pub fn from_parts(
        field: &str,
        rotations: &[f64],
        translation: [f64; 3],
    ) -> Result<Self, ViewError> {
        finite(field, rotations, 1e3)?;
        finite("translation", &translation, pose_track::MAX_METRES)?;
        let (joints, rest) = rotations.as_chunks::<3>();
        if !rest.is_empty() || joints.is_empty() {
            return Err(ViewError::new(
                field,
                format!("{} numbers: 3 per joint are needed", rotations.len()),
            ));
        }
        Ok(Self {
            rotations: joints.iter().map(|r| r.map(|v| v as f32)).collect(),
            translation: translation.map(|v| v as f32),
        })
    }

    /// [`Pose::rotations_f64`] in the body frame, where the root has no rotation.
    pub fn unrooted(&self) -> Vec<Vec3> {
        let mut rotations = self.rotations_f64();
        if let Some(root) = rotations.first_mut() {
            *root = [0.0; 3];
        }
        rotations
    }

    /// The rotations in double precision, for kinematics.
    pub fn rotations_f64(&self) -> Vec<Vec3> {
        self.rotations.iter().map(|r| r.map(f64::from)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_come_back_and_faults_are_named() {
        let pose = Pose {
            rotations: vec![[0.1, 0.2, 0.3], [0.0; 3]],
            translation: [0.0, 1.0, 2.0],
        };
        assert_eq!(Pose::from_proto(&pose.to_proto()), Ok(pose.clone()));
        let fault = |break_it: fn(&mut v1::BodyPose)| {
            let mut broken = pose.to_proto();
            break_it(&mut broken);
            Pose::from_proto(&broken).expect_err("broken").field
        };
        assert_eq!(fault(|p| p.rotations.truncate(5)), "pose.rotations");
        assert_eq!(fault(|p| p.rotations.clear()), "pose.rotations");
        assert_eq!(fault(|p| p.rotations[4] = f32::NAN), "pose.rotations[4]");
        assert_eq!(fault(|p| p.translation.push(0.0)), "pose.translation");
        assert_eq!(fault(|p| p.translation[1] = 1e9), "translation[1]");
    }
}
