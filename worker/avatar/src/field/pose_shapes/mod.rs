//! Pose blend shapes of splats: what clothes and flesh do that bones do not explain.
//!
//! A splat at the canonical place x of the person with the code S is moved by
//! Δ = Σᵣ hᵣ(x, S) Σₖ aₖ(x) Bᵣₖ φ(Ωₖ) before its bones carry it. φ(Ωₖ) = R(Ωₖ) − I are the features of SMPL's pose blend
//! shapes (SMPL, eq. 9), aₖ(x) says how near the joint k is, and a network h chooses among R shapes by place
//! and person: it is the attention of the paper's pose condition (eq. 3 to 5), with places as queries and joints
//! as keys. Δ is linear in the features, so that a pose between filmed ones gets an offset between theirs; beyond them,
//! features go on for three times their filmed range, and stay there (docs/research/splats.md).

mod features;
mod host;
mod nearness;

pub(crate) use features::{FeatureRange, Limits};
pub(crate) use host::{HostShapes, mixed};
pub(crate) use nearness::Nearness;

use super::mlp::{Mlp, MlpShape};
use crate::config::{ModelConfig, PoseShapesConfig, Precision};
use crate::host::{ReadError, read};
use crate::identity::blend::Blend;
use crate::identity::stored_names::stored;
use crate::init::Initial;
use crate::motion::body::CanonicalBody;
use burn::module::{Module, Param};
use burn::tensor::{Tensor, TensorData};
use features::{FEATURES, features};
use yoto_capture::camera::Pose;
use yoto_ops::encode::Bands;
use yoto_ops::mlp::Input;

/// Layer of the network that receives the code.
const INJECT: usize = 1;
/// Hidden layers of the network.
const DEPTH: usize = 2;

/// The parameters of all people's pose blend shapes.
#[derive(Module, Debug)]
pub(crate) struct PoseShapes {
    /// h: place and code to `[N, R]`.
    mlp: Mlp,
    /// `[K, 9, 3 R]`: what people have in common.
    pub(crate) basis: Param<Tensor<3>>,
    /// One `[K, 9, 3 R]` per identity, added to the basis.
    own: Vec<Param<Tensor<3>>>,
    /// One `[2, 9 K]` per identity: least and greatest features of the filmed poses. Never trained.
    pose_ranges: Vec<Param<Tensor<2>>>,
}

impl PoseShapes {
    /// Shapes that move nothing yet; `None` if the configuration has none.
    pub(crate) fn new(
        init: &Initial,
        config: &ModelConfig,
        joints: usize,
        identities: usize,
        code_width: usize,
    ) -> Option<Self> {
        let shapes = config.pose_shapes()?;
        let codes: &[_] = match code_width {
            0 => &[],
            width => &[(INJECT, width)],
        };
        let network = MlpShape {
            path: "pose_shapes.mlp",
            input: bands(shapes).width(),
            width: shapes.width,
            depth: DEPTH,
            skip: None,
            codes,
            output: shapes.count,
            output_bound: None,
            precision: config.precision,
        };
        let size = [joints, FEATURES, 3 * shapes.count];
        Some(Self {
            mlp: Mlp::new(init, &network),
            basis: init.zeros("pose_shapes.basis", size),
            own: (0..identities)
                .map(|slot| init.zeros(&format!("pose_shapes.own.{slot}"), size))
                .collect(),
            pose_ranges: (0..identities)
                .map(|slot| bounds(init, slot, &FeatureRange::nothing(joints)))
                .collect(),
        })
    }

    /// Sets the precision that the network multiplies in.
    pub(crate) fn set_precision(&mut self, precision: Precision) {
        self.mlp.set_precision(precision);
    }

    /// Widens the range of poses of the person in `slot` to these `poses` of a capture.
    ///
    /// # Errors
    /// If what is known can't be read from its device.
    pub(crate) fn record_pose_range<'a>(
        &mut self,
        init: &Initial,
        slot: usize,
        poses: impl Iterator<Item = &'a Pose>,
    ) -> Result<(), ReadError> {
        let mut range = self.pose_range(slot)?;
        range.add(poses);
        self.pose_ranges[slot] = bounds(init, slot, &range);
        Ok(())
    }

    /// Appends an identity that is a mixture of two others.
    pub(crate) fn append(&mut self, blend: &Blend) {
        blend.append(&mut self.own);
        blend.append(&mut self.pose_ranges);
    }

    /// Δ `[N, 3]`, metres, of splats with the canonical `means` `[N, 3]` of the person in `slot`, who has the `code`.
    /// No gradient flows to the means through the places, and none to the pose.
    ///
    /// # Errors
    /// If the means can't be read from their device.
    pub(crate) fn offsets(
        &self,
        config: &PoseShapesConfig,
        slot: usize,
        body: &CanonicalBody,
        means: &Tensor<2>,
        pose: &Pose,
        code: Option<Tensor<1>>,
    ) -> Result<Tensor<2>, ReadError> {
        let means = means.clone().detach();
        let device = means.device();
        let [n, _] = means.dims();
        let joints = body.known_joints;
        let near = Nearness::new(&body.skeleton, &body.rest[..joints], config.reach as f32);
        let near = TensorData::new(near.dense(&read(means.clone())?), [n, joints]);
        let near = Tensor::<2>::from_data(near, &device);
        let features = self
            .pose_range(slot)?
            .limits()
            .clamp(features(pose, joints));
        let features = TensorData::new(features, [joints, 1, FEATURES]);
        let features = Tensor::<3>::from_data(features, &device);
        let basis = self.basis.val() + self.own[slot].val();
        // [K, 1, 9] x [K, 9, 3 R]: what each joint's rotation gives each shape.
        let by_joint = features.matmul(basis).reshape([joints, 3 * config.count]);
        let moved = near.matmul(by_joint).reshape([n, 3, config.count]);
        let weights = self.weights(config, body, means, code);
        let weights = weights.reshape([n, 1, config.count]);
        Ok((moved * weights).sum_dim(2).reshape([n, 3]))
    }

    /// h `[N, R]` at canonical `means` `[N, 3]`.
    fn weights(
        &self,
        config: &PoseShapesConfig,
        body: &CanonicalBody,
        means: Tensor<2>,
        code: Option<Tensor<1>>,
    ) -> Tensor<2> {
        // People have their pelvises in different places of their canonical boxes.
        let pelvis = body.rest[0].map(|v| v as f32);
        let pelvis = Tensor::<1>::from_floats(pelvis, &means.device()).unsqueeze::<2>();
        let codes: Vec<_> = code.map(|code| (INJECT, code)).into_iter().collect();
        self.mlp.forward(means - pelvis, bands(config), &codes)
    }

    fn pose_range(&self, slot: usize) -> Result<FeatureRange, ReadError> {
        let bounds = read(self.pose_ranges[slot].val().detach())?;
        Ok(FeatureRange::from_bounds(bounds))
    }
}

fn bands(config: &PoseShapesConfig) -> Input {
    Input::Frequencies {
        bands: Bands::new(config.bands, config.unit as f32),
        raw: true,
    }
}

fn bounds(init: &Initial, slot: usize, range: &FeatureRange) -> Param<Tensor<2>> {
    let numbers = range.bounds();
    let path = stored(&format!("pose_shapes.pose_ranges.{slot}"));
    init.given(&path, [2, numbers.len() / 2], numbers)
        .set_require_grad(false)
}

#[cfg(test)]
mod tests;
