//! Learned motion weights: logits on the canonical grid, added to the logarithm of the prior.
//! In the `direct` form they are parameters, shared by all identities, and a residual for each;
//! in the `deconv` form a decoder makes them ([`super::deconv`]).

use super::deconv::Decoder;
use crate::config::{MotionConfig, MotionForm};
use crate::identity::blend::Blend;
use crate::init::Initial;
use burn::module::{Module, Param};
use burn::tensor::Tensor;
use burn::tensor::activation::softmax;

/// Logits of the motion weights. Direct ones are all 0 at the start: the prior serves.
#[derive(Module, Debug)]
pub struct MotionWeights {
    /// `[K + 1, D³]`, with the direct form.
    base: Option<Param<Tensor<2>>>,
    /// One `[K + 1, D³]` an identity, with the direct form.
    residuals: Vec<Param<Tensor<2>>>,
    /// With the deconv form.
    decoder: Option<Decoder>,
}

impl MotionWeights {
    pub(crate) fn new(
        init: &Initial,
        config: &MotionConfig,
        slots: usize,
        channels: usize,
    ) -> Self {
        let shape = [channels, config.resolution.pow(3)];
        match &config.form {
            MotionForm::Direct => Self {
                base: Some(init.zeros("motion.base", shape)),
                residuals: (0..slots)
                    .map(|slot| init.zeros(&format!("motion.residuals.{slot}"), shape))
                    .collect(),
                decoder: None,
            },
            MotionForm::Deconv {
                embedding,
                hidden,
                channels: widths,
            } => Self {
                base: None,
                residuals: Vec::new(),
                decoder: Some(Decoder::new(
                    init, *embedding, *hidden, widths, slots, channels,
                )),
            },
        }
    }

    /// Appends an identity that is the mixture of two others.
    pub(crate) fn append(&mut self, blend: &Blend) {
        blend.append(&mut self.residuals);
        if let Some(decoder) = &mut self.decoder {
            decoder.append(blend);
        }
    }

    /// `[K + 1, D³]`: softmax over channels of logits plus `log_prior`.
    pub fn volume(&self, slot: usize, log_prior: Tensor<2>) -> Tensor<2> {
        let mut logits = log_prior;
        if let Some(base) = &self.base {
            logits = logits + base.val();
        }
        if let Some(decoded) = self.decoder.as_ref().and_then(|d| d.forward(slot)) {
            logits = logits + decoded;
        }
        if let Some(residual) = self.residuals.get(slot) {
            logits = logits + residual.val();
        }
        softmax(logits, 0)
    }
}
