//! Pose blend shapes of one person in host memory, for pictures, players and files: what does not change with the pose is
//! computed once.

use super::PoseShapes;
use super::features::{FEATURES, Limits, features};
use super::nearness::Nearness;
use crate::config::PoseShapesConfig;
use crate::host::{ReadError, read};
use crate::motion::body::CanonicalBody;
use burn::tensor::{Device, Tensor, TensorData};
use rayon::prelude::*;
use yoto_capture::camera::Pose;

/// Splats per task.
const BLOCK: usize = 512;

/// The pose blend shapes of one person's splats.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct HostShapes {
    /// R.
    pub count: usize,
    /// `[N, R]`.
    pub weights: Vec<f32>,
    /// Distance at which the nearness is e^(−1/2), metres.
    pub reach: f32,
    /// `[K, 9, 3, R]`.
    pub basis: Vec<f32>,
    limits: Limits,
    /// `[N + 1]`: the near joints of splat i are entries `starts[i]..starts[i + 1]`.
    starts: Vec<u32>,
    near: Vec<(u32, f32)>,
}

impl HostShapes {
    /// Reads the shapes of the person in `slot`, who has the `code`, for splats with canonical `means` `[N, 3]`.
    ///
    /// # Errors
    /// If the model can't be read from its device.
    pub(crate) fn read(
        shapes: &PoseShapes,
        config: &PoseShapesConfig,
        slot: usize,
        body: &CanonicalBody,
        means: &[f32],
        code: Option<Tensor<1>>,
        device: &Device,
    ) -> Result<Self, ReadError> {
        let places = Tensor::from_data(
            TensorData::new(means.to_vec(), [means.len() / 3, 3]),
            device,
        );
        let weights = read(shapes.weights(config, body, places, code).detach())?;
        let basis = read((shapes.basis.val() + shapes.own[slot].val()).detach())?;
        let limits = shapes.pose_range(slot)?.limits();
        let near = Nearness::new(
            &body.skeleton,
            &body.rest[..body.known_joints],
            config.reach as f32,
        );
        Ok(Self::new(&near, basis, limits, weights, means))
    }

    /// The shapes of splats at `means` `[N, 3]` with these `weights` `[N, R]`.
    pub(crate) fn new(
        near: &Nearness,
        basis: Vec<f32>,
        limits: Limits,
        weights: Vec<f32>,
        means: &[f32],
    ) -> Self {
        let dense = near.dense(means);
        let joints = near.joints();
        let reach = near.reach();
        let (mut starts, mut near) = (vec![0], Vec::new());
        for row in dense.chunks_exact(joints) {
            let own = row.iter().enumerate().filter(|(_, share)| **share > 0.0);
            near.extend(own.map(|(joint, share)| (joint as u32, *share)));
            starts.push(near.len() as u32);
        }
        Self {
            count: basis.len() / (3 * FEATURES * joints),
            weights,
            reach,
            basis,
            limits,
            starts,
            near,
        }
    }

    /// The same person with fewer splats, at `means` `[N, 3]`. Each replaces a group of the present ones, which have these
    /// weights in it.
    pub(crate) fn merged(
        &self,
        groups: &[Vec<(usize, f32)>],
        body: &CanonicalBody,
        means: &[f32],
    ) -> Self {
        let mixed =
            |group: &Vec<(usize, f32)>| mixed(&self.weights, self.count, group.iter().copied());
        let weights = groups.iter().flat_map(mixed).collect();
        let (basis, limits) = (self.basis.clone(), self.limits.clone());
        let near = Nearness::new(&body.skeleton, &body.rest[..body.known_joints], self.reach);
        Self::new(&near, basis, limits, weights, means)
    }

    /// `[2, 9 K]`: the least and the greatest values with which features take part.
    pub(crate) fn limits(&self) -> &[f32] {
        self.limits.as_slice()
    }

    /// `[K, 3 R]`: what each joint's rotation gives each shape.
    fn by_joint(&self, pose: &Pose) -> Vec<f32> {
        let width = 3 * self.count;
        let joints = self.basis.len() / (FEATURES * width);
        let features = self.limits.clamp(features(pose, joints));
        let joints = self.basis.chunks_exact(FEATURES * width);
        let mut all = Vec::with_capacity(self.basis.len() / FEATURES);
        for (basis, features) in joints.zip(features.chunks_exact(FEATURES)) {
            let mut sums = vec![0f32; width];
            for (row, feature) in basis.chunks_exact(width).zip(features) {
                sums.iter_mut()
                    .zip(row)
                    .for_each(|(sum, b)| *sum += feature * b);
            }
            all.extend(sums);
        }
        all
    }

    /// Adds Δ in `pose` to the first three numbers of each of `rows`.
    pub(crate) fn add<const ROW: usize>(&self, rows: &mut [[f32; ROW]], pose: &Pose) {
        let by_joint = self.by_joint(pose);
        let (count, width) = (self.count, 3 * self.count);
        let rows = rows.par_iter_mut().enumerate().with_min_len(BLOCK);
        rows.for_each(|(i, row)| {
            let weights = &self.weights[i * count..][..count];
            let own = self.starts[i] as usize..self.starts[i + 1] as usize;
            for (joint, share) in &self.near[own] {
                let given = &by_joint[*joint as usize * width..][..width];
                for (to, given) in row.iter_mut().zip(given.chunks_exact(count)) {
                    let sum: f32 = given.iter().zip(weights).map(|(a, b)| a * b).sum();
                    *to += share * sum;
                }
            }
        });
    }
}

/// h `[R]` of a splat in place of a group of those with the `weights` `[N, R]`, of which each has a share in it.
pub(crate) fn mixed(
    weights: &[f32],
    count: usize,
    group: impl Iterator<Item = (usize, f32)>,
) -> Vec<f32> {
    let mut sums = vec![0f32; count];
    for (splat, share) in group {
        let own = &weights[splat * count..][..count];
        for (sum, own) in sums.iter_mut().zip(own) {
            *sum += share * own;
        }
    }
    sums
}
