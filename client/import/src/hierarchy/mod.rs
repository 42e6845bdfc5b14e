//! Joint hierarchies of other programs, retargeted to the T-pose: a person who stands, arms out, y up, facing +z.
//!
//! A program's own rest pose is arbitrary, and so are its joints' axes. The T-pose is made from a standing pose: with global rotations G of a frame, S of the standing pose (turned to face +z, y up), and D
//! the rotation from a limb's direction in the T-pose to its direction in the standing pose, a joint's global rotation
//! from the T-pose is `G Sᵀ D`.
//!
//! ```text
//! BVH: rest pose or most upright frame ┐
//! posed joints: their mean (measured) ─┴→ TPoseRetarget → rest joints; rotations of each frame
//! ```

mod hands;
mod measured;

pub(crate) use measured::{Measured, measure};

use crate::geometry::{
    IDENTITY_ROTATION, Mat3, Vec3, about_axis, add, log_map, matmul, matvec, rotation_between, sub,
    transpose,
};
use yoto_proto::pose_track::Skeleton;

/// Limbs, from one joint to the next, and their directions in a T-pose.
const LIMBS: [(&str, &str, Vec3); 8] = [
    ("l_shoulder", "l_elbow", [1.0, 0.0, 0.0]),
    ("l_elbow", "l_wrist", [1.0, 0.0, 0.0]),
    ("r_shoulder", "r_elbow", [-1.0, 0.0, 0.0]),
    ("r_elbow", "r_wrist", [-1.0, 0.0, 0.0]),
    ("l_hip", "l_knee", [0.0, -1.0, 0.0]),
    ("l_knee", "l_ankle", [0.0, -1.0, 0.0]),
    ("r_hip", "r_knee", [0.0, -1.0, 0.0]),
    ("r_knee", "r_ankle", [0.0, -1.0, 0.0]),
];
/// Joints without a limb of their own. They continue the limb above, as do joints that SMPL lacks.
const FOLLOW: [&str; 4] = ["l_wrist", "r_wrist", "l_hand", "r_hand"];
/// Pairs of joints whose difference points to the left.
const SIDES: [(&str, &str); 2] = [("l_hip", "r_hip"), ("l_shoulder", "r_shoulder")];

/// A joint of a hierarchy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Joint {
    /// Its name in the capture.
    pub name: String,
    /// The joint of SMPL with the same place in the body, if there is one.
    pub role: Option<String>,
    /// Index of the joint above, which comes before.
    pub parent: Option<usize>,
}

/// The joints of a program, or some of them; parents come before children.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct JointHierarchy(pub Vec<Joint>);

/// A pose of a hierarchy in global coordinates; the axes are the caller's.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct GlobalPose {
    /// Global rotations, `[joints, 3, 3]`.
    pub rotations: Vec<Mat3>,
    /// Global positions, `[joints, 3]`.
    pub positions: Vec<Vec3>,
}

impl GlobalPose {
    /// This pose, rotated as a whole.
    pub(crate) fn rotated(&self, by: &Mat3) -> Self {
        Self {
            rotations: self.rotations.iter().map(|it| matmul(by, it)).collect(),
            positions: self.positions.iter().map(|it| matvec(by, *it)).collect(),
        }
    }
}

impl JointHierarchy {
    /// Index of the joint that has the role of SMPL's joint `role`.
    pub(crate) fn find(&self, role: &str) -> Option<usize> {
        self.0
            .iter()
            .position(|joint| joint.role.as_deref() == Some(role))
    }

    /// The position of SMPL's joint `role` in a pose.
    pub(crate) fn position(&self, placed: &GlobalPose, role: &str) -> Option<Vec3> {
        placed.positions.get(self.find(role)?).copied()
    }

    /// The vector from the right to the left hip in a pose, or between the shoulders if a hip is missing.
    pub(crate) fn leftward(&self, placed: &GlobalPose) -> Option<Vec3> {
        SIDES.iter().find_map(|(left, right)| {
            Some(sub(
                self.position(placed, left)?,
                self.position(placed, right)?,
            ))
        })
    }

    /// The retarget to the T-pose, made from `pose`, a standing pose with y up.
    pub(crate) fn retarget(&self, pose: &GlobalPose) -> TPoseRetarget<'_> {
        let pose = pose.rotated(&self.facing(pose));
        let limb_rotations = self.limb_rotations(&pose.positions);
        TPoseRetarget {
            rest: self.t_pose(&pose.positions, &limb_rotations),
            hierarchy: self,
            standing: pose,
            limb_rotations,
        }
    }

    /// The rotation about y that takes the left of `pose` to +x.
    fn facing(&self, pose: &GlobalPose) -> Mat3 {
        match self.leftward(pose) {
            Some(left) if left[0].hypot(left[2]) > 1e-6 => about_axis(1, left[2].atan2(left[0])),
            _ => IDENTITY_ROTATION,
        }
    }

    /// D of each joint, for limbs of the standing pose `positions`.
    fn limb_rotations(&self, positions: &[Vec3]) -> Vec<Mat3> {
        let mut limb_rotations: Vec<Mat3> = Vec::with_capacity(self.0.len());
        for (at, joint) in self.0.iter().enumerate() {
            let role = joint.role.as_deref();
            let limb = LIMBS.iter().find(|(from, ..)| role == Some(*from));
            let limb = limb.and_then(|(_, to, direction)| {
                let end = positions.get(self.find(to)?).copied()?;
                rotation_between(*direction, sub(end, positions.get(at).copied()?))
            });
            let before = joint
                .parent
                .and_then(|above| limb_rotations.get(above))
                .copied();
            let before = before.unwrap_or(IDENTITY_ROTATION);
            let hand = role.and_then(|role| hands::rotation(self, positions, role, &before));
            limb_rotations.push(match (limb.or(hand), role) {
                (Some(rotation), _) => rotation,
                (None, Some(role)) if !FOLLOW.contains(&role) && !hands::is_finger(role) => {
                    IDENTITY_ROTATION
                }
                (None, _) => before,
            });
        }
        limb_rotations
    }

    /// Joint positions in the T-pose, from the standing pose `positions` and D of each joint.
    fn t_pose(&self, positions: &[Vec3], limb_rotations: &[Mat3]) -> Vec<Vec3> {
        let mut rest: Vec<Vec3> = Vec::with_capacity(positions.len());
        for (joint, position) in self.0.iter().zip(positions) {
            let Some(parent) = joint.parent else {
                rest.push(*position);
                continue;
            };
            let bone = sub(
                *position,
                positions.get(parent).copied().unwrap_or_default(),
            );
            let rotation = transpose(
                &limb_rotations
                    .get(parent)
                    .copied()
                    .unwrap_or(IDENTITY_ROTATION),
            );
            let from = rest.get(parent).copied().unwrap_or_default();
            rest.push(add(from, matvec(&rotation, bone)));
        }
        rest
    }
}

/// A hierarchy with its T-pose.
pub(crate) struct TPoseRetarget<'a> {
    hierarchy: &'a JointHierarchy,
    /// The standing pose, facing +z.
    standing: GlobalPose,
    /// D of each joint.
    limb_rotations: Vec<Mat3>,
    /// Joint positions in the T-pose, `[joints, 3]`.
    pub rest: Vec<Vec3>,
}

impl TPoseRetarget<'_> {
    /// The axis-angle vector of each joint, relative to its parent and from the T-pose, of a pose with the global `rotations`.
    pub(crate) fn local_rotations(&self, rotations: &[Mat3]) -> Vec<Vec3> {
        let global = rotations
            .iter()
            .zip(&self.standing.rotations)
            .zip(&self.limb_rotations);
        let global: Vec<Mat3> = global
            .map(|((global, standing), limb)| matmul(&matmul(global, &transpose(standing)), limb))
            .collect();
        let local = |(joint, rotation): (&Joint, &Mat3)| {
            let above = joint.parent.and_then(|above| global.get(above));
            let above = above.copied().unwrap_or(IDENTITY_ROTATION);
            log_map(&matmul(&transpose(&above), rotation))
        };
        self.hierarchy.0.iter().zip(&global).map(local).collect()
    }

    /// The skeleton with the rest joints multiplied by `scale`.
    pub(crate) fn skeleton(&self, scale: f64) -> Skeleton {
        let parent = |joint: &Joint| joint.parent.map_or(-1, |above| above as i32);
        Skeleton {
            names: self.hierarchy.0.iter().map(|it| it.name.clone()).collect(),
            parents: self.hierarchy.0.iter().map(parent).collect(),
            rest_joints: self.rest.iter().map(|it| it.map(|v| v * scale)).collect(),
        }
    }
}
