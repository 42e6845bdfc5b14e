//! Non-rigid motion, as HumanNeRF has it with the paper's code F_nr: how cloth moves beyond what the bones do, by pose.

use super::mlp::{Mlp, MlpShape};
use super::window::hann_window;
use crate::config::{BeforeKickIn, ModelConfig, NonRigidConfig, Precision};
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

    /// Canonical `points` `[N, 3]`, metres, moved. `pose` is the pose vector `[3 (K − 1)]`,
    /// `code` F_nr; `progress`, a share of the run, opens the bands one after the other. Before
    /// the kick-in both are zeros where the network runs at all ([`BeforeKickIn`]).
    pub fn forward(
        &self,
        config: &ModelConfig,
        points: Tensor<2>,
        pose: Tensor<1>,
        code: Option<Tensor<1>>,
        progress: f64,
    ) -> Tensor<2> {
        let field = &config.non_rigid;
        let (pose, code) = match (config.schedule.moves_points(progress), field.before_kick_in) {
            (true, _) => (pose, code),
            (false, BeforeKickIn::Rests) => return points,
            (false, BeforeKickIn::Runs) => (pose.zeros_like(), code.map(|code| code.zeros_like())),
        };
        let a = config.schedule.open_bands(progress, field.bands);
        let kind = Input::Frequencies {
            bands: Bands {
                window: Some(hann_window(field.bands, a)),
                ..Bands::new(field.bands, 1.0)
            },
            raw: false,
        };
        let mut codes = vec![(0, pose)];
        codes.extend(code.map(|code| (field.layers.inject, code)));
        points.clone() + self.mlp.forward(points, kind, &codes)
    }
}
