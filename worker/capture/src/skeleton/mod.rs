//! The joint hierarchy of a subject: names, parents, rest positions.
//!
//! The skeleton is data that travels with a capture, never a constant. [`kinematics`] and [`retarget`]
//! work on any hierarchy whose parents come before their children.

mod average;
mod bounds;
pub mod face;
pub mod feet;
pub mod fingers;
pub mod kinematics;
pub mod parts;
mod pose;
pub mod readings;
mod retarget;
pub mod smpl;
pub mod timing;
pub mod transform;

pub use bounds::Bounds;
pub use pose::Pose;
pub use retarget::transfer;
pub use transform::{Mat34, Vec3};

use serde::{Deserialize, Serialize};
use yoto_proto::pose_track;

/// Joints, each after its parent.
///
/// A skeleton that is read is checked. One that is built by hand must have at least a root, lists of equal
/// length, and parents before their children.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Unchecked")]
pub struct Skeleton {
    /// `[K]` names.
    pub names: Vec<String>,
    /// `[K]` indices of parents, each smaller than its child's; the root, joint 0, has none.
    pub parents: Vec<Option<usize>>,
    /// `[K, 3]` rest (T-pose) positions, metres.
    pub rest: Vec<Vec3>,
}

/// A skeleton as it is stored.
#[derive(Deserialize)]
struct Unchecked {
    names: Vec<String>,
    parents: Vec<Option<usize>>,
    rest: Vec<Vec3>,
}

impl TryFrom<Unchecked> for Skeleton {
    type Error = SkeletonError;

    fn try_from(stored: Unchecked) -> Result<Self, SkeletonError> {
        // A parent beyond i32 is beyond every joint too.
        let parent = |parent: Option<usize>| {
            parent.map_or(-1, |parent| i32::try_from(parent).unwrap_or(i32::MAX))
        };
        Self::from_track(&pose_track::Skeleton {
            names: stored.names,
            parents: stored.parents.into_iter().map(parent).collect(),
            rest_joints: stored.rest,
        })
    }
}

/// Why a skeleton, or a pose for it, can't be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SkeletonError {
    /// The joint count is 0 or too high.
    #[error("skeleton.parents: {0} joints, 1 to {max} are allowed", max = pose_track::MAX_JOINTS)]
    JointCount(usize),
    /// A list does not have one entry per joint.
    #[error("skeleton.{field}: {found} entries for {joints} joints")]
    Length {
        /// The list.
        field: &'static str,
        /// Its entries.
        found: usize,
        /// Entries of `parents`.
        joints: usize,
    },
    /// A joint's parent does not come before it.
    #[error(
        "skeleton.parents[{joint}]: {parent}: joint 0 is the root (-1), every other joint comes \
         after its parent"
    )]
    BadTree {
        /// The joint.
        joint: usize,
        /// Its parent in the list.
        parent: i32,
    },
    /// A rest position is not a number, or is farther away than any body reaches.
    #[error("skeleton.rest_joints[{0}]: not a position in metres")]
    BadRest(usize),
    /// A pose has another number of joints.
    #[error("pose: {found} rotations for {joints} joints")]
    WrongPose {
        /// Rotations of the pose.
        found: usize,
        /// Joints of the skeleton.
        joints: usize,
    },
    /// Two skeletons have few joint names in common: most of the body would stay at rest.
    #[error(
        "the skeletons share {shared} of {of} joint names; the one that moves has {driver}, the body {body}: \
         joints move those of the same name"
    )]
    FewShared {
        /// Names that both have.
        shared: usize,
        /// Joints of the smaller one.
        of: usize,
        /// Joints of the moving skeleton that the body lacks.
        driver: String,
        /// Joints of the body that the moving skeleton lacks.
        body: String,
    },
    /// A root at the height of its lowest joint gives no scale between bodies.
    #[error("a skeleton's root is not above its lowest joint, so bodies can't be scaled")]
    NoHipHeight,
}

impl Skeleton {
    /// The checked skeleton of a pose track.
    ///
    /// # Errors
    /// Lists of different lengths, a parent that does not come before its child, or a rest position that is
    /// not a number.
    pub fn from_track(track: &pose_track::Skeleton) -> Result<Self, SkeletonError> {
        let joints = track.parents.len();
        if joints == 0 || joints > pose_track::MAX_JOINTS {
            return Err(SkeletonError::JointCount(joints));
        }
        for (field, found) in [
            ("names", track.names.len()),
            ("rest_joints", track.rest_joints.len()),
        ] {
            if found != joints {
                return Err(SkeletonError::Length {
                    field,
                    found,
                    joints,
                });
            }
        }
        let parent_of = |(joint, &parent): (usize, &i32)| match usize::try_from(parent) {
            Err(_) if joint == 0 && parent == -1 => Ok(None),
            Ok(index) if index < joint => Ok(Some(index)),
            _ => Err(SkeletonError::BadTree { joint, parent }),
        };
        let parents = track
            .parents
            .iter()
            .enumerate()
            .map(parent_of)
            .collect::<Result<_, _>>()?;
        let plausible = |p: &Vec3| p.iter().all(|v| v.abs() <= pose_track::MAX_METRES);
        if let Some(joint) = track.rest_joints.iter().position(|p| !plausible(p)) {
            return Err(SkeletonError::BadRest(joint));
        }
        Ok(Self {
            names: track.names.clone(),
            parents,
            rest: track.rest_joints.clone(),
        })
    }

    /// The skeleton of a pose track; [`Skeleton::from_track`] reads it back.
    pub fn to_track(&self) -> pose_track::Skeleton {
        pose_track::Skeleton {
            names: self.names.clone(),
            parents: self
                .parents
                .iter()
                .map(|parent| parent.map_or(-1, |parent| parent as i32))
                .collect(),
            rest_joints: self.rest.clone(),
        }
    }

    /// The number of joints, K.
    pub fn joints(&self) -> usize {
        self.parents.len()
    }

    /// The root's rest position, metres.
    ///
    /// # Panics
    /// Without joints; a checked skeleton has at least one.
    pub fn root(&self) -> Vec3 {
        self.rest[0]
    }

    /// The children of every joint.
    pub fn children(&self) -> Vec<Vec<usize>> {
        let mut children = vec![Vec::new(); self.joints()];
        for (joint, parent) in self.parents.iter().enumerate() {
            if let Some(parent) = *parent {
                children[parent].push(joint);
            }
        }
        children
    }

    /// Whether `pose` has one rotation per joint.
    ///
    /// # Errors
    /// [`SkeletonError::WrongPose`] otherwise.
    pub fn check_pose(&self, pose: &Pose) -> Result<(), SkeletonError> {
        if pose.rotations.len() == self.joints() {
            Ok(())
        } else {
            Err(SkeletonError::WrongPose {
                found: pose.rotations.len(),
                joints: self.joints(),
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shoulder at 1 m, elbow 0.3 m and wrist 0.5 m along +x.
    pub(super) fn arm() -> Skeleton {
        Skeleton {
            names: ["shoulder", "elbow", "wrist"].map(String::from).to_vec(),
            parents: vec![None, Some(0), Some(1)],
            rest: vec![[0.0, 1.0, 0.0], [0.3, 1.0, 0.0], [0.5, 1.0, 0.0]],
        }
    }

    #[test]
    fn a_track_comes_back() {
        let skeleton = arm();
        assert_eq!(
            Skeleton::from_track(&skeleton.to_track()),
            Ok(skeleton.clone())
        );
        assert_eq!(skeleton.children(), vec![vec![1], vec![2], vec![]]);
    }

    #[test]
    fn stored_skeletons_come_back_and_broken_ones_are_refused() {
        let stored = serde_json::to_value(arm()).expect("json");
        let rest = serde_json::json!([[0.0, 1.0, 0.0], [0.3, 1.0, 0.0], [0.5, 1.0, 0.0]]);
        assert_eq!(stored["rest"], rest);
        let read = |json: serde_json::Value| serde_json::from_value::<Skeleton>(json);
        assert_eq!(read(stored.clone()).expect("valid"), arm());
        for (field, value) in [
            ("parents", serde_json::json!([null, null, 1])),
            ("parents", serde_json::json!([null, 0, 1_u64 << 40])),
            ("rest", serde_json::json!([])),
        ] {
            let mut broken = stored.clone();
            broken[field] = value;
            let error = read(broken).expect_err(field).to_string();
            assert!(error.starts_with("skeleton."), "{error}");
        }
    }

    #[test]
    fn broken_tracks_are_refused() {
        type Break = fn(&mut pose_track::Skeleton);
        let cases: &[(Break, &str)] = &[
            (|s| s.parents[0] = 0, "skeleton.parents[0]: 0"),
            (|s| s.parents[2] = 2, "skeleton.parents[2]: 2"),
            (|s| s.parents[2] = -1, "skeleton.parents[2]: -1"),
            (|s| s.parents.clear(), "skeleton.parents: 0 joints"),
            (|s| s.names.truncate(1), "skeleton.names: 1 entries"),
            (
                |s| s.rest_joints[1][2] = f64::NAN,
                "skeleton.rest_joints[1]",
            ),
        ];
        for (break_it, expected) in cases {
            let mut track = arm().to_track();
            break_it(&mut track);
            let error = Skeleton::from_track(&track).expect_err(expected);
            assert!(error.to_string().starts_with(expected), "{error}");
        }
    }
}
