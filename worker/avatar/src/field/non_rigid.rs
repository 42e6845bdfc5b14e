//! Non-rigid motion (model.md §5): how cloth moves beyond what the bones do, by pose.

use super::mlp::{Mlp, MlpShape};
use super::window::hann_window;
use crate::config::{NonRigidConfig, Precision};
use crate::init::Initial;
use crate::ops::encode::Bands;
use crate::ops::mlp::Input;
use burn::module::Module;
use burn::tensor::Tensor;

/// Offsets of canonical points.
#[derive(Module, Debug)]
pub struct NonRigid {
    mlp: Mlp,
}

/// Output weights start in ± this, so that nothing moves at first (HumanNeRF).
const OUTPUT_BOUND: f64 = 1e-5;

impl NonRigid {
    /// Multiplies in `precision` from now on.
    pub(crate) fn set_precision(&mut self, precision: Precision) {
        self.mlp.set_precision(precision);
    }

    pub(crate) fn new(
        init: &Initial,
        config: &NonRigidConfig,
        pose_width: usize,
        code_width: usize,
        precision: Precision,
    ) -> Self {
        let codes: &[_] = if code_width > 0 {
            &[(0, pose_width), (config.layers.inject, code_width)]
        } else {
            &[(0, pose_width)]
        };
        let shape = MlpShape {
            path: "non_rigid",
            input: 6 * config.bands,
            width: config.layers.width,
            depth: config.layers.depth,
            skip: config.layers.skip,
            codes,
            output: 3,
            output_bound: Some(OUTPUT_BOUND),
            precision,
        };
        Self {
            mlp: Mlp::new(init, &shape),
        }
    }

    /// Canonical `points` `[N, 3]`, moved. `pose` is the pose vector, `code` F_nr; `step` opens
    /// the bands one after the other.
    pub fn forward(
        &self,
        config: &NonRigidConfig,
        points: Tensor<2>,
        pose: Tensor<1>,
        code: Option<Tensor<1>>,
        step: u64,
    ) -> Tensor<2> {
        if step < config.kick_in {
            return points;
        }
        self.moved(config, points, pose, code, step)
    }

    /// The same as the released program has it: before the kick-in the network runs with closed
    /// bands and a pose of zeros, and what it answers still moves the points.
    pub fn forward_as_released(
        &self,
        config: &NonRigidConfig,
        points: Tensor<2>,
        pose: Tensor<1>,
        code: Option<Tensor<1>>,
        step: u64,
    ) -> Tensor<2> {
        let pose = if step < config.kick_in {
            pose.zeros_like()
        } else {
            pose
        };
        self.moved(config, points, pose, code, step)
    }

    fn moved(
        &self,
        config: &NonRigidConfig,
        points: Tensor<2>,
        pose: Tensor<1>,
        code: Option<Tensor<1>>,
        step: u64,
    ) -> Tensor<2> {
        let span = (config.full_at.saturating_sub(config.kick_in)).max(1) as f32;
        let a = config.bands as f32 * step.saturating_sub(config.kick_in) as f32 / span;
        let kind = Input::Frequencies {
            bands: Bands {
                window: Some(hann_window(config.bands, a)),
                ..Bands::new(config.bands, 1.0)
            },
            raw: false,
        };
        let mut codes = vec![(0, pose)];
        codes.extend(code.map(|code| (config.layers.inject, code)));
        points.clone() + self.mlp.forward(points, kind, &codes)
    }
}
