//! Flags of splats with a guessed colour, since no training frame shows them. The flags are part of the model: a training
//! freezes those colours, and everybody who gets the model can tell which they are.

use super::Avatar;
use crate::field::splats::{Splats, opaque_area};
use crate::host::{ReadError, read};
use burn::module::Module;
use burn::tensor::activation::sigmoid;
use yoto_ops::splat::MIN_ALPHA;

impl Avatar {
    /// Freezes the colours of the splats `frozen` `[N]` of the identity in `slot`; with `None`, all learn.
    pub(crate) fn freeze_colours(
        &mut self,
        slot: usize,
        frozen: Option<&[bool]>,
    ) -> Result<(), ReadError> {
        self.change_splats(slot, |init, splats| {
            splats.freeze_colours(init, slot, frozen);
            Ok(())
        })
    }

    /// Whether colours of the splats of the identity in `slot` are frozen.
    pub(crate) fn has_frozen_colours(&self, slot: usize) -> bool {
        self.splats.get(slot).is_some_and(|it| it.frozen.is_some())
    }

    /// Flags of the splats of the identity in `slot` that have a frozen colour, which is guessed; `None` if nothing was guessed.
    pub(crate) fn frozen_colours(&self, slot: usize) -> Result<Option<Vec<bool>>, ReadError> {
        let frozen = self.splats.get(slot).and_then(|it| it.frozen.as_ref());
        let flags = frozen
            .map(|frozen| read(frozen.val().detach()))
            .transpose()?;
        Ok(flags.map(|flags| flags.into_iter().map(|flag| flag > 0.5).collect()))
    }

    /// Share of the area of the splats of the identity in `slot` whose colour is guessed, 0 to 1.
    pub(crate) fn guessed_share(&self, slot: usize) -> Result<f64, ReadError> {
        let (Some(frozen), Some(splats)) = (self.frozen_colours(slot)?, self.splats.get(slot))
        else {
            return Ok(0.0);
        };
        let opacities = read(sigmoid(splats.opacities.val().detach()))?;
        let scales = read(splats.scales.val().detach().exp())?;
        let scales = scales.as_chunks::<3>().0;
        let (mut all, mut guessed) = (0.0, 0.0);
        for ((frozen, opacity), scales) in frozen.iter().zip(opacities).zip(scales) {
            if opacity > MIN_ALPHA {
                let area = f64::from(opaque_area(opacity, *scales));
                all += area;
                guessed += if *frozen { area } else { 0.0 };
            }
        }
        Ok(guessed / all.max(f64::MIN_POSITIVE))
    }

    /// Number of parameters, without what is never trained: flags of guessed colours, and bones of a surface.
    pub(crate) fn parameters(&self) -> usize {
        self.num_params() - self.flags()
    }

    /// Number of numbers that are never trained.
    pub(super) fn flags(&self) -> usize {
        let constants = |splats: &Splats| {
            let frozen = splats.frozen.as_ref();
            let bones = [&splats.bones, &splats.bone_weights].into_iter().flatten();
            frozen.map_or(0, |it| it.val().shape().num_elements())
                + bones
                    .map(|it| it.val().shape().num_elements())
                    .sum::<usize>()
        };
        self.splats.iter().map(constants).sum()
    }
}
