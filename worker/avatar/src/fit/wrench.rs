//! Forces on the bones of a body, and their effect on its pose.

use rayon::prelude::*;
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::transform::{
    Mat34, Vec3, add, cross, inverse as inverted, position, rotate, sub,
};

/// A force and its moment about the origin: how a number changes with the shift of a bone, per metre,
/// and with its rotation, per radian.
#[derive(Clone, Copy, Default)]
pub(super) struct Wrench {
    pub force: Vec3,
    pub moment: Vec3,
}

impl Wrench {
    /// The wrench of a `force` at a point.
    pub(super) fn at(at: Vec3, force: Vec3) -> Self {
        let moment = cross(at, force);
        Self { force, moment }
    }

    pub(super) fn add(&mut self, other: Self) {
        self.force = add(self.force, other.force);
        self.moment = add(self.moment, other.moment);
    }
}

/// The Jacobian `[R, 3 (K + 1)]` of R numbers to the rotation of each joint by a vector in its own
/// posed axes, radians, and to the shift of the root in its own axes, metres, from their `wrenches`
/// `[R, K]` on bones whose joints are at `joints` in the body frame.
pub(super) fn jacobian(
    skeleton: &Skeleton,
    joints: &[Mat34],
    mut wrenches: Vec<Wrench>,
) -> Vec<f64> {
    let bones = joints.len();
    let width = 3 * (bones + 1);
    let mut rows = vec![0.0; wrenches.len() / bones * width];
    let numbers = wrenches.par_chunks_exact_mut(bones);
    let numbers = numbers.zip(rows.par_chunks_exact_mut(width));
    numbers.for_each(|(wrenches, row)| {
        // Parents come before their children.
        for (joint, transform) in joints.iter().enumerate().rev() {
            let below = wrenches[joint];
            if let Some(parent) = skeleton.parents[joint] {
                wrenches[parent].add(below);
            }
            let about = sub(below.moment, cross(position(transform), below.force));
            let rotation = rotate(&inverted(transform), about);
            row[3 * joint..3 * joint + 3].copy_from_slice(&rotation);
        }
        row[3 * bones..].copy_from_slice(&wrenches[0].force);
    });
    rows
}
