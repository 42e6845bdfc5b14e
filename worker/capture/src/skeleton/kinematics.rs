//! Forward kinematics: from joint rotations to joint transforms, positions and bounds.

use super::transform::{
    IDENTITY, Mat34, Vec3, add, apply, compose, position, rigid, rodrigues, sub,
};
use super::{Bounds, Pose, Skeleton};

impl Skeleton {
    /// Every joint's frame in body space, with the root at its rest position:
    /// `G_k = G_parent · [R_k | rest_k - rest_parent]`. A joint without an entry in `rotations` is not
    /// rotated; [`Skeleton::check_pose`] finds such poses.
    pub fn global_transforms(&self, rotations: &[Vec3]) -> Vec<Mat34> {
        let mut globals: Vec<Mat34> = Vec::with_capacity(self.joints());
        for joint in 0..self.joints() {
            let rotation = rodrigues(rotations.get(joint).copied().unwrap_or_default());
            let rest = self.rest[joint];
            globals.push(match self.parents[joint] {
                None => rigid(rotation, rest),
                Some(parent) => compose(
                    &globals[parent],
                    &rigid(rotation, sub(rest, self.rest[parent])),
                ),
            });
        }
        globals
    }

    /// Every joint's frame in the world: [`Skeleton::global_transforms`] moved by the pose's
    /// translation.
    pub fn world_transforms(&self, pose: &Pose) -> Vec<Mat34> {
        let shift = Mat34::from(std::array::from_fn(|i| {
            let mut row = IDENTITY[i];
            row[3] = f64::from(pose.translation[i]);
            row
        }));
        self.global_transforms(&pose.rotations_f64())
            .iter()
            .map(|g| compose(&shift, g))
            .collect()
    }

    /// Joint positions in the world, metres.
    pub fn posed_joints(&self, pose: &Pose) -> Vec<Vec3> {
        self.world_transforms(pose).iter().map(position).collect()
    }

    /// Joint positions in the body frame, with the root at rest, metres.
    pub fn body_frame_joints(&self, pose: &Pose) -> Vec<Vec3> {
        let transforms = self.global_transforms(&pose.unrooted());
        transforms.iter().map(position).collect()
    }

    /// The motion from the body frame, where the root is at its rest position without rotation, to the
    /// world. A camera's extrinsics times this are its extrinsics in the body frame.
    pub fn body_to_world(&self, pose: &Pose) -> Mat34 {
        let root = self.root();
        let rotation = rodrigues(
            pose.rotations
                .first()
                .map(|r| r.map(f64::from))
                .unwrap_or_default(),
        );
        let turned = apply(&rigid(rotation, [0.0; 3]), root);
        let translation = pose.translation.map(f64::from);
        rigid(rotation, sub(add(root, translation), turned))
    }

    /// The box around the rest joints, grown by `margin` metres.
    pub fn rest_bounds(&self, margin: f64) -> Bounds {
        Bounds::around(&self.rest, margin)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::arm;
    use super::super::transform::length;
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn at_identity_joints_stand_at_rest() {
        let skeleton = arm();
        let joints = skeleton.posed_joints(&Pose::rest(3));
        for (joint, rest) in joints.iter().zip(&skeleton.rest) {
            assert!(length(sub(*joint, *rest)) < 1e-15);
        }
    }

    #[test]
    fn a_bent_elbow_moves_only_what_hangs_on_it() {
        let mut pose = Pose::rest(3);
        pose.rotations[1] = [0.0, 0.0, (PI / 2.0) as f32];
        pose.translation = [0.0, 0.0, 2.0];
        let joints = arm().posed_joints(&pose);
        let expected = [[0.0, 1.0, 2.0], [0.3, 1.0, 2.0], [0.3, 1.2, 2.0]];
        for (joint, wanted) in joints.iter().zip(expected) {
            assert!(length(sub(*joint, wanted)) < 1e-7, "{joints:?}");
        }
    }

    #[test]
    fn the_body_frame_leads_back_to_the_world() {
        let mut pose = Pose::rest(3);
        pose.rotations = vec![[0.2, 1.4, -0.3], [0.0, 0.5, 0.7], [0.1, 0.0, 0.0]];
        pose.translation = [0.5, -0.1, 0.2];
        let world = arm().posed_joints(&pose);
        let body = Pose {
            rotations: vec![[0.0; 3], pose.rotations[1], pose.rotations[2]],
            translation: [0.0; 3],
        };
        let to_world = arm().body_to_world(&pose);
        for (inside, outside) in arm().posed_joints(&body).iter().zip(world) {
            assert!(length(sub(apply(&to_world, *inside), outside)) < 1e-12);
        }
    }

    #[test]
    fn bounds_hold_every_joint_with_its_margin() {
        let bounds = arm().rest_bounds(0.1);
        assert!(length(sub(bounds.min, [-0.1, 0.9, -0.1])) < 1e-12);
        assert!(length(sub(bounds.max, [0.6, 1.1, 0.1])) < 1e-12);
    }
}
