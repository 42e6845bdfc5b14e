//! Somebody between two identities: their codes, and all else that tells them apart, mixed.

use crate::motion::body::Body;
use crate::render::{RenderError, Renderer};
use burn::module::{Param, ParamId};
use burn::tensor::Tensor;

/// Two identities of a model, and how much of the second is in the mixture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Blend {
    pub from: usize,
    pub to: usize,
    /// 0: all `from`; 1: all `to`.
    pub share: f32,
}

impl Blend {
    /// Appends the mixture to parameters of which each identity has one. Where identities share
    /// what they have, there is nothing to mix.
    pub(crate) fn append<const D: usize>(&self, params: &mut Vec<Param<Tensor<D>>>) {
        if let (Some(from), Some(to)) = (params.get(self.from), params.get(self.to)) {
            let mixed = from.val() * (1.0 - self.share) + to.val() * self.share;
            params.push(Param::initialized(ParamId::new(), mixed));
        }
    }
}

impl Renderer {
    /// The model with one more identity between those in the slots `from` and `to`, and its slot:
    /// identity code, motion weights, tables and rest joints are mixed, `share` (0 to 1) of them
    /// those of `to`.
    ///
    /// # Errors
    /// When a slot is empty, or `share` is not from 0 to 1.
    pub fn with_blend(
        mut self,
        from: usize,
        to: usize,
        share: f32,
    ) -> Result<(Self, usize), RenderError> {
        if !(0.0..=1.0).contains(&share) {
            return Err(RenderError::Settings(format!(
                "share: {share} is not between 0 and 1"
            )));
        }
        let skeleton = |slot| self.skeleton(slot).ok_or(RenderError::NoSuchSlot(slot));
        let (first, second) = (skeleton(from)?, skeleton(to)?);
        let mut mixed = first.clone();
        for (joint, other) in mixed.rest.iter_mut().zip(&second.rest) {
            for (a, b) in joint.iter_mut().zip(other) {
                *a += f64::from(share) * (b - *a);
            }
        }
        self.avatar.append(&Blend { from, to, share });
        let body = Body::new(mixed, &self.config, &self.device());
        Ok(self.with_body(body))
    }
}
