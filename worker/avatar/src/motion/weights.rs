//! Learned motion weights: logits on the canonical grid, added to the logarithm of the prior.
//! In the `direct` form the logits are parameters: a base shared by all identities and a residual
//! per identity, which may be on a coarser grid. In the `deconv` form a decoder computes them (`motion/deconv.rs`).

use super::deconv::Decoder;
use super::upsample::upsampled;
use crate::config::{MotionConfig, MotionForm, Resolution};
use crate::identity::blend::Blend;
use crate::init::Initial;
use burn::module::{Module, Param};
use burn::tensor::Tensor;
use yoto_ops::bone_softmax::bone_softmax;
use yoto_ops::warp::inverse::solve::Skinning;

/// The bone that moves most of a canonical point.
pub(crate) fn strongest(skinning: &Skinning<'_>, point: [f32; 3]) -> usize {
    let weights = skinning.skinning_weights(point).into_iter();
    let most = weights.max_by(|(_, a), (_, b)| a.total_cmp(b));
    most.map_or(0, |(bone, _)| bone)
}

/// Logits of the motion weights. The direct form starts with 0, which gives the prior.
#[derive(Module, Debug)]
pub struct MotionWeights {
    /// `[K + 1, V]`; only in the direct form.
    base: Option<Param<Tensor<2>>>,
    /// One `[K + 1, W]` per identity; only in the direct form.
    residuals: Vec<Param<Tensor<2>>>,
    /// Grids of the base and of the residuals.
    #[module(skip)]
    grids: [Resolution; 2],
    /// Only in the deconv form.
    decoder: Option<Decoder>,
}

impl MotionWeights {
    pub(crate) fn new(
        init: &Initial,
        config: &MotionConfig,
        slots: usize,
        channels: usize,
    ) -> Self {
        let grids = [config.resolution, config.own()];
        let [base, own] = grids.map(|grid| [channels, grid.voxels()]);
        match &config.form {
            MotionForm::Direct => Self {
                base: Some(init.zeros("motion.base", base)),
                residuals: (0..slots)
                    .map(|slot| init.zeros(&format!("motion.residuals.{slot}"), own))
                    .collect(),
                grids,
                decoder: None,
            },
            MotionForm::Deconv {
                embedding,
                hidden,
                channels: widths,
            } => Self {
                base: None,
                residuals: Vec::new(),
                grids,
                decoder: Some(Decoder::new(
                    init, *embedding, *hidden, widths, slots, channels,
                )),
            },
        }
    }

    /// Appends an identity that is a mixture of two others.
    pub(crate) fn append(&mut self, blend: &Blend) {
        blend.append(&mut self.residuals);
        if let Some(decoder) = &mut self.decoder {
            decoder.append(blend);
        }
    }

    /// `[K + 1, V]`: softmax over channels of the logits of the identity in `slot` plus
    /// `log_prior`.
    ///
    /// # Panics
    /// If there is no identity in `slot`.
    pub fn volume(&self, slot: usize, log_prior: Tensor<2>) -> Tensor<2> {
        let logits = match (&self.decoder, &self.base) {
            (Some(decoder), _) => decoder.forward(slot),
            (None, Some(base)) => {
                let [shared, own] = self.grids;
                base.val() + upsampled(self.residuals[slot].val(), own, shared)
            }
            (None, None) => unreachable!("motion weights with neither decoder nor base"),
        };
        bone_softmax(logits, log_prior)
    }
}
