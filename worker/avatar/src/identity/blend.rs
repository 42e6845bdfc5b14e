//! Interpolation between two identities: their codes and all other per-identity parameters.

use burn::module::{Param, ParamId};
use burn::tensor::Tensor;

/// Two identities of a model, and the share of the second in their mixture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Blend {
    pub from: usize,
    pub to: usize,
    /// 0: all `from`; 1: all `to`.
    pub share: f32,
}

impl Blend {
    /// Appends the mixture to `params`, which has one entry per identity, or none in models
    /// without this parameter.
    ///
    /// # Panics
    /// If `params` has entries, but none for one of the two identities.
    pub(crate) fn append<const D: usize>(&self, params: &mut Vec<Param<Tensor<D>>>) {
        if params.is_empty() {
            return;
        }
        let (from, to) = (params[self.from].val(), params[self.to].val());
        let mixed = from * (1.0 - self.share) + to * self.share;
        params.push(Param::initialized(ParamId::new(), mixed));
    }
}
