//! Trees of joints of other programs, whose rest pose is a person's: standing, arms in a T, y up, facing +z.
//!
//! What a program calls its rest pose is arbitrary, and its joints' axes are too. The person's is made from a
//! standing pose: with global rotations G of a frame, S of the standing pose (turned to face +z, y up), and D
//! the rotation that takes a limb of a T-pose to the limb of the standing one, the joint's global rotation
//! from the rest pose is `G Sᵀ D`.
//!
//! ```text
//! BVH: rest pose or most upright frame ┐
//! posed joints: their mean (measured) ─┴→ Standing → rest joints; rotations of each frame
//! ```

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
/// Joints without a limb, which continue the direction of the previous one; so do those that are none of
/// SMPL's.
const FOLLOW: [&str; 4] = ["l_wrist", "r_wrist", "l_hand", "r_hand"];
/// Pairs that define left.
const SIDES: [(&str, &str); 2] = [("l_hip", "r_hip"), ("l_shoulder", "r_shoulder")];

/// A joint of a tree.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Joint {
    /// Its name in the capture.
    pub name: String,
    /// The joint of SMPL that it stands for, if there is one.
    pub role: Option<String>,
    /// Index of the joint above, which comes before.
    pub parent: Option<usize>,
}

/// The joints of a program, or some of them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Tree(pub Vec<Joint>);

/// The joints of a tree in a pose, in whatever axes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Placed {
    /// Global rotations, `[joints, 3, 3]`.
    pub rotations: Vec<Mat3>,
    /// `[joints, 3]`.
    pub positions: Vec<Vec3>,
}

impl Placed {
    /// The pose rotated as a whole.
    pub fn rotated(&self, by: &Mat3) -> Self {
        Self {
            rotations: self.rotations.iter().map(|it| matmul(by, it)).collect(),
            positions: self.positions.iter().map(|it| matvec(by, *it)).collect(),
        }
    }
}

impl Tree {
    /// Index of the joint that stands for SMPL's `role`.
    pub fn find(&self, role: &str) -> Option<usize> {
        self.0
            .iter()
            .position(|joint| joint.role.as_deref() == Some(role))
    }

    /// The position of SMPL's joint `role` in a pose.
    pub fn position(&self, placed: &Placed, role: &str) -> Option<Vec3> {
        placed.positions.get(self.find(role)?).copied()
    }

    /// From the right to the left hip in a pose, or from shoulder to shoulder if a hip is missing.
    pub fn leftward(&self, placed: &Placed) -> Option<Vec3> {
        SIDES.iter().find_map(|(left, right)| {
            Some(sub(
                self.position(placed, left)?,
                self.position(placed, right)?,
            ))
        })
    }

    /// The rest pose made of `pose`, a standing pose with y up.
    pub fn standing(&self, pose: &Placed) -> Standing<'_> {
        let pose = pose.rotated(&self.facing(pose));
        let limbs = self.limbs(&pose.positions);
        Standing {
            rest: self.t_pose(&pose.positions, &limbs),
            tree: self,
            pose,
            limbs,
        }
    }

    /// The rotation about the vertical that turns the left of `pose` to +x.
    fn facing(&self, pose: &Placed) -> Mat3 {
        match self.leftward(pose) {
            Some(left) if left[0].hypot(left[2]) > 1e-6 => about_axis(1, left[2].atan2(left[0])),
            _ => IDENTITY_ROTATION,
        }
    }

    /// D of each joint, of limbs that stand as `positions`.
    fn limbs(&self, positions: &[Vec3]) -> Vec<Mat3> {
        let mut limbs: Vec<Mat3> = Vec::with_capacity(self.0.len());
        for (at, joint) in self.0.iter().enumerate() {
            let role = joint.role.as_deref();
            let limb = LIMBS.iter().find(|(from, ..)| role == Some(*from));
            let limb = limb.and_then(|(_, to, direction)| {
                let end = positions.get(self.find(to)?).copied()?;
                rotation_between(*direction, sub(end, positions.get(at).copied()?))
            });
            let before = joint.parent.and_then(|above| limbs.get(above)).copied();
            limbs.push(match (limb, role) {
                (Some(rotation), _) => rotation,
                (None, Some(role)) if !FOLLOW.contains(&role) => IDENTITY_ROTATION,
                (None, _) => before.unwrap_or(IDENTITY_ROTATION),
            });
        }
        limbs
    }

    /// Rest positions with the limbs in a T-pose.
    fn t_pose(&self, positions: &[Vec3], limbs: &[Mat3]) -> Vec<Vec3> {
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
            let rotation = transpose(&limbs.get(parent).copied().unwrap_or(IDENTITY_ROTATION));
            let from = rest.get(parent).copied().unwrap_or_default();
            rest.push(add(from, matvec(&rotation, bone)));
        }
        rest
    }
}

/// A tree with a rest pose.
pub(crate) struct Standing<'a> {
    tree: &'a Tree,
    /// The pose that stands, facing +z.
    pose: Placed,
    /// D of each joint.
    limbs: Vec<Mat3>,
    /// Rest joints.
    pub rest: Vec<Vec3>,
}

impl Standing<'_> {
    /// Axis-angle of each joint, local to its parent, of the global rotations of a pose.
    pub fn local(&self, rotations: &[Mat3]) -> Vec<Vec3> {
        let global = rotations.iter().zip(&self.pose.rotations).zip(&self.limbs);
        let global: Vec<Mat3> = global
            .map(|((global, standing), limb)| matmul(&matmul(global, &transpose(standing)), limb))
            .collect();
        let local = |(joint, rotation): (&Joint, &Mat3)| {
            let above = joint.parent.and_then(|above| global.get(above));
            let above = above.copied().unwrap_or(IDENTITY_ROTATION);
            log_map(&matmul(&transpose(&above), rotation))
        };
        self.tree.0.iter().zip(&global).map(local).collect()
    }

    /// The skeleton, with rest joints times `scale`.
    pub fn skeleton(&self, scale: f64) -> Skeleton {
        let parent = |joint: &Joint| joint.parent.map_or(-1, |above| above as i32);
        Skeleton {
            names: self.tree.0.iter().map(|it| it.name.clone()).collect(),
            parents: self.tree.0.iter().map(parent).collect(),
            rest_joints: self.rest.iter().map(|it| it.map(|v| v * scale)).collect(),
        }
    }
}
