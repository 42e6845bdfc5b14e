//! A standing pose for programs whose files lack the rest pose: the mean, over the frames, of each joint's rotation relative
//! to its parent.
//!
//! A bone is constant in the axes of its parent joint, `G_parentᵀ (p − p_parent)`. The median over the frames is taken;
//! the scatter around it shows whether rotations and positions belong together.

use super::{GlobalPose, JointHierarchy};
use crate::geometry::{
    IDENTITY_ROTATION, Mat3, Vec3, add, cross, dot, log_map, matmul, matvec, rodrigues, scale, sub,
    transpose,
};
use crate::track::median_rows;
use yoto_capture::skeleton::transform::length;

/// Most frames that are measured.
const MOST: usize = 300;
/// Iterations of a mean of rotations: each leaves a small part of the error before.
const STEPS: usize = 8;

/// What the frames of a hierarchy have in common.
pub(crate) struct Measured {
    /// A standing pose, y up, facing +z.
    pub standing: GlobalPose,
    /// Median distance of joints from their positions with constant bones, metres.
    pub scatter: f64,
}

/// Measures `frames` of `hierarchy`; `None` where the up or left direction is unknown.
pub(crate) fn measure(hierarchy: &JointHierarchy, frames: &[&GlobalPose]) -> Option<Measured> {
    let step = frames.len().div_ceil(MOST).max(1);
    let frames: Vec<&GlobalPose> = frames.iter().step_by(step).copied().collect();
    let mut scatter = Vec::new();
    let mut mean = GlobalPose {
        rotations: Vec::new(),
        positions: Vec::new(),
    };
    for (joint, it) in hierarchy.0.iter().enumerate() {
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
    let standing = mean.rotated(&upright(hierarchy, &mean)?);
    let middle = scatter.len() / 2;
    let scatter = match scatter.get(middle) {
        Some(_) => *scatter.select_nth_unstable_by(middle, f64::total_cmp).1,
        None => 0.0,
    };
    Some(Measured { standing, scatter })
}

/// The rotation that takes the direction from the pelvis to the neck to +y, and the left to +x.
fn upright(hierarchy: &JointHierarchy, pose: &GlobalPose) -> Option<Mat3> {
    let top = ["neck", "head", "spine3"];
    let top = top.iter().find_map(|role| hierarchy.position(pose, role))?;
    let up = unit(sub(top, hierarchy.position(pose, "pelvis")?))?;
    let left = hierarchy.leftward(pose)?;
    let left = unit(sub(left, scale(up, dot(left, up))))?;
    Some([left, up, cross(left, up)])
}

/// The mean of `rotations`: the axis-angle vectors from it to them add up to zero.
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
