//! The bones that carry the splats of an identity, in host memory.

use super::{AvatarSplats, Posed};
use crate::field::splats::BONES;
use crate::host::{ReadError, read};
use crate::motion::body::CanonicalBody;
use yoto_ops::warp::skin::weights::SkinningWeights;

impl AvatarSplats<'_> {
    /// The bones that carry each splat of a posed identity, and their weights, which sum to 1.
    ///
    /// # Errors
    /// If the model can't be read from its device.
    pub(crate) fn skinning_weights(
        &self,
        body: &CanonicalBody,
        posed: &Posed,
    ) -> Result<SkinningWeights, ReadError> {
        let [count, _] = self.splats[posed.slot].means.val().dims();
        let all: Vec<usize> = (0..count).collect();
        self.skinning_weights_of(body, posed, &all)
    }

    /// As [`Self::skinning_weights`], of the `chosen` splats, in their order.
    ///
    /// # Errors
    /// If the model can't be read from its device.
    pub(crate) fn skinning_weights_of(
        &self,
        body: &CanonicalBody,
        posed: &Posed,
        chosen: &[usize],
    ) -> Result<SkinningWeights, ReadError> {
        let splats = &self.splats[posed.slot];
        let weights = read(posed.weights.clone().detach())?;
        let means = rows::<3>(chosen, &read(self.canonical_means(posed).detach())?);
        Ok(match (&splats.bones, &splats.bone_weights) {
            (Some(bones), Some(base)) => {
                let bones = rows::<BONES>(chosen, &read(bones.val().detach())?);
                let base = rows::<BONES>(chosen, &read(base.val().detach())?);
                let factored = body.known_joints;
                SkinningWeights::of_surface(
                    &weights, factored, &means, &bones, &base, BONES, &body.grid,
                )
            }
            _ => SkinningWeights::new(&weights, body.known_joints, &means, &body.grid),
        })
    }
}

/// The `chosen` rows of `values` `[N, W]`.
fn rows<const W: usize>(chosen: &[usize], values: &[f32]) -> Vec<f32> {
    let row = |index: &usize| &values[W * index..W * (index + 1)];
    chosen.iter().flat_map(row).copied().collect()
}
