//! A standing pose of joints whose program's own rest pose is not in its files: the mean of what each joint
//! does against the joint above it.
//!
//! Bones are of constant length in the axes of the joint above, `G_parentᵀ (p − p_parent)`: the
//! median over the frames is taken, and its scatter tells whether rotations and positions belong together.

use super::{Placed, Tree};
use crate::geometry::{
    IDENTITY_ROTATION, Mat3, Vec3, add, cross, dot, log_map, matmul, matvec, rodrigues, scale, sub,
    transpose,
};
use crate::track::median_rows;
use yoto_capture::skeleton::transform::length;

/// Frames that are measured, at most.
const MOST: usize = 300;
/// Steps of a mean of rotations: each leaves a small part of the error of the one before.
const STEPS: usize = 8;

/// What frames of a tree have in common.
pub(crate) struct Measured {
    /// A pose that stands, y up, facing +z.
    pub standing: Placed,
    /// Median distance of joints from where constant bones put them, metres.
    pub scatter: f64,
}

/// Measures `frames` of `tree`; `None` where the up or left direction is unknown.
pub(crate) fn measure(tree: &Tree, frames: &[&Placed]) -> Option<Measured> {
    let step = frames.len().div_ceil(MOST).max(1);
    let frames: Vec<&Placed> = frames.iter().step_by(step).copied().collect();
    let mut scatter = Vec::new();
    let mut mean = Placed {
        rotations: Vec::new(),
        positions: Vec::new(),
    };
    for (joint, it) in tree.0.iter().enumerate() {
        let Some(parent) = it.parent else {
            mean.rotations.push(IDENTITY_ROTATION);
            mean.positions.push([0.0; 3]);
            continue;
        };
        let (mut offsets, mut rotations) = (Vec::new(), Vec::new());
        for frame in &frames {
            let back = transpose(frame.rotations.get(parent)?);
            let bone = sub(*frame.positions.get(joint)?, *frame.positions.get(parent)?);
            offsets.push(matvec(&back, bone));
            rotations.push(matmul(&back, frame.rotations.get(joint)?));
        }
        let rows: Vec<&[f64]> = offsets.iter().map(<[f64; 3]>::as_slice).collect();
        let offset: Vec3 = median_rows(&rows).try_into().ok()?;
        scatter.extend(offsets.iter().map(|it| length(sub(*it, offset))));
        let (above, from) = (*mean.rotations.get(parent)?, *mean.positions.get(parent)?);
        mean.rotations
            .push(matmul(&above, &mean_rotation(&rotations)));
        mean.positions.push(add(from, matvec(&above, offset)));
    }
    let standing = mean.rotated(&upright(tree, &mean)?);
    let middle = scatter.len() / 2;
    let scatter = match scatter.get(middle) {
        Some(_) => *scatter.select_nth_unstable_by(middle, f64::total_cmp).1,
        None => 0.0,
    };
    Some(Measured { standing, scatter })
}

/// The rotation that makes the way from the pelvis to the neck up, and that to the left hip +x.
fn upright(tree: &Tree, pose: &Placed) -> Option<Mat3> {
    let top = ["neck", "head", "spine3"];
    let top = top.iter().find_map(|role| tree.position(pose, role))?;
    let up = unit(sub(top, tree.position(pose, "pelvis")?))?;
    let left = tree.leftward(pose)?;
    let left = unit(sub(left, scale(up, dot(left, up))))?;
    Some([left, up, cross(left, up)])
}

/// The mean of `rotations`: from it, their axis-angle vectors add up to zero.
fn mean_rotation(rotations: &[Mat3]) -> Mat3 {
    let mut mean = rotations.first().copied().unwrap_or(IDENTITY_ROTATION);
    for _ in 0..STEPS {
        let back = transpose(&mean);
        let ways = rotations
            .iter()
            .map(|rotation| log_map(&matmul(&back, rotation)));
        let way = ways.fold([0.0; 3], add);
        mean = matmul(
            &mean,
            &rodrigues(scale(way, 1.0 / rotations.len().max(1) as f64)),
        );
    }
    mean
}

fn unit(v: Vec3) -> Option<Vec3> {
    let length = length(v);
    (length > 1e-6).then(|| scale(v, 1.0 / length))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_of_rotations_lies_between_them() {
        let rotations = [
            [0.3, 0.0, 0.0],
            [-0.1, 0.0, 0.0],
            [0.1, 0.5, 0.0],
            [0.1, -0.5, 0.0],
        ];
        let mean = log_map(&mean_rotation(&rotations.map(rodrigues)));
        let off = sub(mean, [0.1, 0.0, 0.0]);
        assert!(length(off) < 1e-2, "{mean:?}");
        assert_eq!(mean_rotation(&[]), IDENTITY_ROTATION);
    }
}
