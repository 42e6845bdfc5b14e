//! The prior of the motion weights: a Gaussian around each bone, background elsewhere (HumanNeRF;
//! the numbers are those of its released program).

use yoto_capture::body_box::MARGIN;
use yoto_capture::skeleton::Skeleton;
use yoto_ops::warp::WarpGrid;

/// Standard deviations of a bone's blob across, along and across it, metres.
const BONE_STD: [f64; 3] = [0.03, 0.06, 0.03];
/// Factor on the width of torso bones.
const TORSO_FACTOR: f64 = 1.5;
/// Standard deviation of the blob around a joint without children, metres.
const LEAF_STD: f64 = 0.02;
/// Standard deviation of the blob around the head, metres.
const HEAD_STD: f64 = 0.06;
/// Smallest sum that channels are divided by.
const MIN_TOTAL: f64 = 1e-3;
/// Parts of the names of torso joints: SMPL's 0, 3, 6, 9, 13, 14, and their usual names in other
/// skeletons.
const TORSO: [&str; 6] = ["pelvis", "hips", "spine", "chest", "collar", "clavicle"];

/// Whether a joint's bones are part of the torso.
pub(crate) fn is_torso(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    TORSO.iter().any(|part| name.contains(part))
}

/// The canonical box of a skeleton. The warp ignores weights below a thousandth of `epsilon`, the
/// smallest likelihood at which samples are evaluated.
pub fn canonical_grid(skeleton: &Skeleton, nodes: [usize; 3], epsilon: f32) -> WarpGrid {
    let bounds = skeleton.rest_bounds(MARGIN);
    WarpGrid {
        min: bounds.min.map(|v| v as f32),
        max: bounds.max.map(|v| v as f32),
        nodes,
        floor: epsilon * 1e-3,
    }
}

/// One Gaussian blob, in its own axes.
struct Blob {
    joint: usize,
    middle: [f64; 3],
    /// Unit direction of the bone.
    along: [f64; 3],
    /// 1/(2σ) across and along.
    across_scale: f64,
    along_scale: f64,
}

impl Blob {
    fn weight(&self, point: [f64; 3]) -> f64 {
        let offset: [f64; 3] = std::array::from_fn(|a| point[a] - self.middle[a]);
        let along: f64 = (0..3).map(|a| offset[a] * self.along[a]).sum();
        let total: f64 = offset.iter().map(|o| o * o).sum();
        // Both standard deviations across the bone are equal, so only the distance from the
        // bone's line matters, and no rotation (singular for bones along −y) is needed.
        let across = (total - along * along).max(0.0);
        (-(across * self.across_scale.powi(2) + along * along * self.along_scale.powi(2))).exp()
    }
}

fn blobs(skeleton: &Skeleton) -> Vec<Blob> {
    let mut blobs = Vec::new();
    for (joint, name) in skeleton.names.iter().enumerate() {
        let position = skeleton.rest[joint];
        let factor = if is_torso(name) { TORSO_FACTOR } else { 1.0 };
        let mut leaf = true;
        for (child, _) in skeleton
            .parents
            .iter()
            .enumerate()
            .filter(|(_, parent)| **parent == Some(joint))
        {
            leaf = false;
            let end = skeleton.rest[child];
            let bone: [f64; 3] = std::array::from_fn(|a| end[a] - position[a]);
            let length = bone.iter().map(|b| b * b).sum::<f64>().sqrt();
            // A bone without length is a point, for which any direction serves.
            let along = if length > 1e-9 {
                bone.map(|b| b / length)
            } else {
                [0.0, 1.0, 0.0]
            };
            blobs.push(Blob {
                joint,
                middle: std::array::from_fn(|a| (position[a] + end[a]) / 2.0),
                along,
                across_scale: 1.0 / (2.0 * BONE_STD[0] * factor),
                along_scale: 1.0 / (2.0 * BONE_STD[1]),
            });
        }
        if leaf {
            let scale = 1.0
                / (2.0
                    * if name.to_ascii_lowercase().contains("head") {
                        HEAD_STD
                    } else {
                        LEAF_STD
                    });
            blobs.push(Blob {
                joint,
                middle: position,
                along: [0.0, 1.0, 0.0],
                across_scale: scale,
                along_scale: scale,
            });
        }
    }
    blobs
}

/// The sum of the bones' Gaussians around a skeleton in the rest pose.
pub(crate) struct Halo(Vec<Blob>);

impl Halo {
    pub(crate) fn new(skeleton: &Skeleton) -> Self {
        Self(blobs(skeleton))
    }

    /// The sum at `point`, metres.
    pub(crate) fn at(&self, point: [f64; 3]) -> f64 {
        self.0.iter().map(|blob| blob.weight(point)).sum()
    }
}

/// The prior `[K + 1, V]` (V nodes: z, y, x with x fastest), the background last; each node's channels
/// sum to 1, or to less where nothing is near.
pub fn prior(skeleton: &Skeleton, grid: &WarpGrid) -> Vec<f32> {
    let [across, down, _] = grid.nodes;
    let joints = skeleton.parents.len();
    let voxels = grid.voxels();
    let blobs = blobs(skeleton);
    let mut volume = vec![0f32; (joints + 1) * voxels];
    let node = |a: usize, i: usize| {
        let (min, max) = (f64::from(grid.min[a]), f64::from(grid.max[a]));
        min + (max - min) * i as f64 / (grid.nodes[a] - 1) as f64
    };
    let mut channels = vec![0f64; joints];
    for voxel in 0..voxels {
        let point = [
            node(0, voxel % across),
            node(1, voxel / across % down),
            node(2, voxel / (across * down)),
        ];
        channels.fill(0.0);
        for blob in &blobs {
            channels[blob.joint] += blob.weight(point);
        }
        let sum: f64 = channels.iter().sum();
        let background = 1.0 - sum.clamp(0.0, 1.0);
        let total = (sum + background).max(MIN_TOTAL);
        for (joint, weight) in channels.iter().enumerate() {
            volume[joint * voxels + voxel] = (weight / total) as f32;
        }
        volume[joints * voxels + voxel] = (background / total) as f32;
    }
    volume
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bone(towards: [f64; 3]) -> (Skeleton, WarpGrid) {
        let skeleton = Skeleton {
            names: vec!["l_knee".into(), "l_ankle".into()],
            parents: vec![None, Some(0)],
            rest: vec![[0.0; 3], towards],
        };
        let grid = canonical_grid(&skeleton, [9; 3], 0.0);
        (skeleton, grid)
    }

    #[test]
    fn channels_sum_to_one_and_bones_weigh_most_at_themselves() {
        let (skeleton, grid) = bone([0.0, 0.4, 0.0]);
        let volume = prior(&skeleton, &grid);
        for voxel in 0..729 {
            let sum: f32 = (0..3).map(|channel| volume[channel * 729 + voxel]).sum();
            assert!((sum - 1.0).abs() < 1e-6, "voxel {voxel}: {sum}");
        }
        // Node (4, 4, 4) is the middle of the box, and of the bone.
        let middle = 4 * 81 + 4 * 9 + 4;
        let at = |channel: usize| volume[channel * 729 + middle];
        assert!(
            at(0) > 0.9 && at(1) < 0.1 && at(2) < 0.1,
            "{} {} {}",
            at(0),
            at(1),
            at(2)
        );
        // The corner is far from everything.
        assert!(volume[2 * 729] > 0.999);
    }

    #[test]
    fn a_bone_along_minus_y_is_the_mirror_of_one_along_y() {
        let (up, up_grid) = bone([0.0, 0.4, 0.0]);
        let (down, down_grid) = bone([0.0, -0.4, 0.0]);
        let (up, down) = (prior(&up, &up_grid), prior(&down, &down_grid));
        for (voxel, weight) in up.iter().enumerate() {
            let (channel, voxel) = (voxel / 729, voxel % 729);
            let (z, y, x) = (voxel / 81, voxel / 9 % 9, voxel % 9);
            let mirrored = channel * 729 + z * 81 + (8 - y) * 9 + x;
            assert!((weight - down[mirrored]).abs() < 1e-5);
        }
    }

    #[test]
    fn bones_without_length_and_joints_at_one_point_are_finite() {
        let (skeleton, grid) = bone([0.0; 3]);
        assert!(prior(&skeleton, &grid).iter().all(|w| w.is_finite()));
    }
}
