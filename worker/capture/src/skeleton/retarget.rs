//! One person's motion on another person's skeleton.

use super::feet::Footing;
use super::{Pose, Skeleton, SkeletonError, Vec3};
use yoto_proto::pose_track;

/// The motion `poses` of `driver`, at `seconds` each and in a world with the unit vector `up`, as `target`
/// would make it: each pose as [`retarget`] has it, and on another body than the driver's with feet that
/// rest where the driver's do, in place of sliding on legs of other proportions.
///
/// # Errors
/// Those of [`retarget`], with the place of the pose.
pub fn transfer(
    driver: &Skeleton,
    target: &Skeleton,
    poses: &[Pose],
    seconds: &[f64],
    up: Vec3,
) -> Result<Vec<Pose>, (usize, SkeletonError)> {
    let moved = poses.iter().enumerate();
    let moved = moved.map(|(at, pose)| retarget(driver, target, pose).map_err(|error| (at, error)));
    let mut moved = moved.collect::<Result<Vec<_>, _>>()?;
    if driver.rest != target.rest {
        Footing::of(driver, poses, seconds, up).plant(target, &mut moved, seconds);
    }
    Ok(moved)
}

/// `pose` of `driver`, as `target` would take it.
///
/// Rotations are copied by joint name; joints of the target that the driver lacks stay at
/// rest. The translation is scaled by the ratio of hip heights, so that feet which stood on
/// the floor stand on it again and strides fit the legs.
///
/// # Errors
/// The pose does not fit the driver, no joint name is shared, or a skeleton's root is no
/// higher (y) than its lowest joint, so that there is no hip height to compare.
pub fn retarget(driver: &Skeleton, target: &Skeleton, pose: &Pose) -> Result<Pose, SkeletonError> {
    driver.check_pose(pose)?;
    let matches: Vec<Option<usize>> = target
        .names
        .iter()
        .map(|name| driver.names.iter().position(|other| other == name))
        .collect();
    if matches.iter().all(Option::is_none) {
        return Err(SkeletonError::NothingShared);
    }
    let ratio = target.hip_height()? / driver.hip_height()?;
    Ok(Pose {
        rotations: matches
            .iter()
            .map(|joint| joint.map_or([0.0; 3], |joint| pose.rotations[joint]))
            .collect(),
        translation: pose.translation.map(|v| (f64::from(v) * ratio) as f32),
    })
}

impl Skeleton {
    /// The checked skeleton of a motion. Without rest joints it has those of `body` by name, so that the motion
    /// has the size of whoever takes it.
    ///
    /// # Errors
    /// Those of [`Self::from_track`].
    pub fn of_motion(motion: &pose_track::Skeleton, body: &Self) -> Result<Self, SkeletonError> {
        if !motion.rest_joints.is_empty() {
            return Self::from_track(motion);
        }
        let root = body.rest.first().copied().unwrap_or_default();
        let place = |name: &String| {
            let at = body.names.iter().position(|other| other == name);
            at.and_then(|at| body.rest.get(at)).copied().unwrap_or(root)
        };
        Self::from_track(&pose_track::Skeleton {
            rest_joints: motion.names.iter().map(place).collect(),
            ..motion.clone()
        })
    }

    /// The root's rest height above the lowest rest joint, metres.
    pub(super) fn hip_height(&self) -> Result<f64, SkeletonError> {
        let root = self.root()[1];
        let lowest = self.rest.iter().map(|p| p[1]).fold(root, f64::min);
        let height = root - lowest;
        if height > 1e-6 {
            Ok(height)
        } else {
            Err(SkeletonError::NoHipHeight)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn legs(names: &[&str], hip: f64) -> Skeleton {
        Skeleton {
            names: names.iter().map(|&n| n.to_owned()).collect(),
            parents: vec![None, Some(0), Some(1)],
            rest: vec![[0.0, hip, 0.0], [0.0, hip / 2.0, 0.0], [0.0, 0.0, 0.0]],
        }
    }

    #[test]
    fn rotations_follow_names_and_translation_follows_height() {
        let driver = legs(&["pelvis", "knee", "ankle"], 1.0);
        let target = legs(&["pelvis", "tail", "knee"], 0.5);
        let pose = Pose {
            rotations: vec![[0.1; 3], [0.2; 3], [0.3; 3]],
            translation: [0.4, -0.2, 1.0],
        };
        let moved = retarget(&driver, &target, &pose).expect("two names are shared");
        assert_eq!(moved.rotations, vec![[0.1; 3], [0.0; 3], [0.2; 3]]);
        assert_eq!(moved.translation, [0.2, -0.1, 0.5]);
        assert_eq!(retarget(&driver, &driver, &pose), Ok(pose));
    }

    #[test]
    fn what_cannot_be_retargeted_is_refused() {
        let driver = legs(&["pelvis", "knee", "ankle"], 1.0);
        let stranger = legs(&["a", "b", "c"], 1.0);
        let pose = Pose::rest(3);
        assert_eq!(
            retarget(&driver, &stranger, &pose),
            Err(SkeletonError::NothingShared)
        );
        assert_eq!(
            retarget(&driver, &driver, &Pose::rest(2)),
            Err(SkeletonError::WrongPose {
                found: 2,
                joints: 3
            })
        );
        let flat = legs(&["pelvis", "knee", "ankle"], 0.0);
        assert_eq!(
            retarget(&driver, &flat, &pose),
            Err(SkeletonError::NoHipHeight)
        );
    }
}
