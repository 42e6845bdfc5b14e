//! Non-rigid motion: pose-dependent offsets, such as those of cloth, that bones do not explain.
//! HumanNeRF's network with the paper's code F_nr.

use super::mlp::{Mlp, MlpShape};
use super::window::hann_window;
use crate::config::{BeforeKickIn, ModelConfig, NonRigidConfig, Precision};
use crate::init::Initial;
use burn::module::Module;
use burn::tensor::Tensor;
use yoto_ops::encode::Bands;
use yoto_ops::mlp::Input;

/// Offsets of canonical points.
#[derive(Module, Debug)]
pub struct NonRigid {
    mlp: Mlp,
}

/// Initial output weights are uniform in ± this, so that offsets start near 0 (HumanNeRF).
const OUTPUT_BOUND: f64 = 1e-5;

impl NonRigid {
    /// Sets the precision that the network multiplies in.
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

    /// Canonical `points` `[N, 3]`, metres, with their offsets added. `pose` is the pose vector
    /// `[3 (K − 1)]` and `code` F_nr. Bands open one after the other with `progress`, the
    /// completed fraction of the run. Before the kick-in, the network gets zeros for pose and
    /// code, or does not run ([`BeforeKickIn`]).
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
