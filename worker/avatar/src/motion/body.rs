//! The constants of one identity: its skeleton, canonical box, and prior.

use super::prior::{canonical_grid, prior};
use crate::config::{Encoding, ModelConfig, Numerics};
use burn::tensor::{Device, Tensor, TensorData};
use yoto_capture::skeleton::smpl::joints_of_body;
use yoto_capture::skeleton::{Skeleton, Vec3};
use yoto_ops::hash::HashGrid;
use yoto_ops::warp::WarpGrid;

/// Smallest prior weight: the logarithm of 0 is −∞, and a softmax of it has no gradient.
const MIN_PRIOR: f32 = 1e-12;

/// One identity's body.
#[derive(Clone, Debug)]
pub struct CanonicalBody {
    /// Joint tree with the rest positions that poses move: the person's own, or those of another body.
    pub skeleton: Skeleton,
    /// Rest positions of the person's own joints, metres, in the canonical box.
    pub rest: Vec<Vec3>,
    /// Number of joints K that the model's networks and volumes know. Joints of fingers come after them: they carry splats that lie on
    /// the fingers of a body's surface, and nothing else.
    pub known_joints: usize,
    /// Box of the motion weights.
    pub grid: WarpGrid,
    /// Hash grid over the same box, if the encoding is one. This is the grid of the
    /// shared table.
    pub hash: Option<HashGrid>,
    /// Logarithm of the prior `[K + 1, V]`, the background last.
    pub log_prior: Tensor<2>,
}

impl CanonicalBody {
    /// The body of `skeleton`, its constants on `device`.
    pub fn new(skeleton: Skeleton, config: &ModelConfig, device: &Device) -> Self {
        let grid = canonical_grid(
            &skeleton,
            config.motion.resolution.nodes(),
            config.box_epsilon(),
        );
        let known_joints = joints_of_body(&skeleton);
        let values: Vec<f32> = prior(&first_joints(&skeleton, known_joints), &grid)
            .iter()
            .map(|p| match config.numerics {
                Numerics::Sound => p.max(MIN_PRIOR).ln(),
                // A weight of exactly 0 stays 0, whatever the logits.
                Numerics::Reference => p.ln(),
            })
            .collect();
        let shape = [known_joints + 1, config.motion.resolution.voxels()];
        let log_prior = Tensor::from_data(TensorData::new(values, shape), device);
        let encoding = config.appearance.encoding();
        let hash = encoding.and_then(|encoding| hash_grid(encoding, &grid));
        Self {
            rest: skeleton.rest.clone(),
            skeleton,
            known_joints,
            grid,
            hash,
            log_prior,
        }
    }
}

impl CanonicalBody {
    /// This body on the bones of another skeleton with as many joints: bones have the other's lengths and
    /// distances, and each keeps this person's flesh and clothes.
    pub fn on_bones_of(mut self, skeleton: Skeleton) -> Self {
        self.skeleton = skeleton;
        self
    }
}

/// The skeleton of the first `count` joints.
fn first_joints(skeleton: &Skeleton, count: usize) -> Skeleton {
    Skeleton {
        names: skeleton.names[..count].to_vec(),
        parents: skeleton.parents[..count].to_vec(),
        rest: skeleton.rest[..count].to_vec(),
    }
}

/// The hash grid of an encoding over a canonical box; `None` for the Fourier encoding.
pub fn hash_grid(encoding: &Encoding, grid: &WarpGrid) -> Option<HashGrid> {
    let Encoding::Hash {
        levels,
        base,
        growth,
        log2_rows,
        features,
        ..
    } = *encoding
    else {
        return None;
    };
    let side = (0..3)
        .map(|a| grid.max[a] - grid.min[a])
        .fold(0.0, f32::max);
    Some(HashGrid::new(
        levels, base, growth, log2_rows, features, grid.min, side,
    ))
}
