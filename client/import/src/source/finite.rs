//! Names the SMPL parameter that is not finite, by its joint.

use super::{Part, is_number};
use crate::ImportError;
use crate::track::SmplPose;
use yoto_proto::smpl::JOINTS;

/// The first number that is not finite among the rotations of `pose`, three for each joint, and then among the parts of
/// `others`, in words: `the rotation of l_knee is NaN`.
pub(crate) fn not_finite(pose: &[f64], others: &[(&str, &[f64])]) -> Option<String> {
    let bad = |values: &[f64]| values.iter().copied().find(|value| !is_number(*value));
    let joint = |(rotation, (name, _)): (&[f64; 3], &(&str, _))| {
        Some(format!("the rotation of {name} is {}", bad(rotation)?))
    };
    let part = |(name, values): &(&str, &[f64])| Some(format!("{name} is {}", bad(values)?));
    let (rotations, _) = pose.as_chunks::<3>();
    let mut rotations = rotations.iter().zip(&JOINTS);
    rotations
        .find_map(joint)
        .or_else(|| others.iter().find_map(part))
}

impl Part<'_> {
    /// SMPL's 24 rotations, all finite.
    pub(crate) fn smpl_pose(&self) -> Result<SmplPose, ImportError> {
        let array = self.unchecked()?;
        let pose: SmplPose = array.fixed().ok_or_else(|| self.wrong("[72]"))?;
        match not_finite(&pose, &[]) {
            None => Ok(pose),
            Some(message) => Err(self.fault("NOT_FINITE", message)),
        }
    }
}
