//! Which splats have a guessed colour, since no training frame shows them. Their flags are part of the model: a training
//! holds those colours, and whoever gets the model knows which they are.

use super::Avatar;
use crate::host::{ReadError, read};
use burn::module::Module;
use burn::tensor::activation::sigmoid;
use yoto_ops::splat::MIN_ALPHA;

impl Avatar {
    /// Holds the guessed colours of the splats `held` `[N]` of the identity in `slot`; with `None`, all learn.
    pub(crate) fn hold_splats(
        &mut self,
        slot: usize,
        held: Option<&[bool]>,
    ) -> Result<(), ReadError> {
        self.change_splats(slot, |init, splats| {
            splats.hold(init, slot, held);
            Ok(())
        })
    }

    /// Whether guessed colours of the splats of the identity in `slot` are held.
    pub(crate) fn holds_splats(&self, slot: usize) -> bool {
        self.splats.get(slot).is_some_and(|it| it.held.is_some())
    }

    /// Which splats of the identity in `slot` have a guessed colour, which is held; `None` if nothing was guessed.
    pub(crate) fn held_splats(&self, slot: usize) -> Result<Option<Vec<bool>>, ReadError> {
        let held = self.splats.get(slot).and_then(|it| it.held.as_ref());
        let flags = held.map(|held| read(held.val().detach())).transpose()?;
        Ok(flags.map(|flags| flags.into_iter().map(|flag| flag > 0.5).collect()))
    }

    /// Share of the splats of the identity in `slot` whose colour is guessed, of those that are drawn, 0 to 1.
    pub(crate) fn guessed_share(&self, slot: usize) -> Result<f64, ReadError> {
        let (Some(held), Some(splats)) = (self.held_splats(slot)?, self.splats.get(slot)) else {
            return Ok(0.0);
        };
        let opacities = read(sigmoid(splats.opacities.val().detach()))?;
        let drawn = held
            .iter()
            .zip(opacities)
            .filter(|(_, opacity)| *opacity > MIN_ALPHA);
        let flags: Vec<bool> = drawn.map(|(held, _)| *held).collect();
        let guessed = flags.iter().filter(|held| **held).count();
        Ok(guessed as f64 / flags.len().max(1) as f64)
    }

    /// Number of parameters, without the flags of guessed colours, which are never trained.
    pub(crate) fn parameters(&self) -> usize {
        self.num_params() - self.flags()
    }

    /// Number of those flags.
    pub(super) fn flags(&self) -> usize {
        let held = self.splats.iter().filter_map(|it| it.held.as_ref());
        held.map(|held| held.val().dims()[0]).sum()
    }
}
