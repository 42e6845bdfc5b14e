//! What a training has made, outside of the service.

use anyhow::Context;
use std::path::Path;
use yoto_avatar::render::{Renderer, SkinnedSplats};

/// The person in `slot` of the model in a folder, which the user knows as `model`.
///
/// # Errors
/// If the model can't be read, has no such slot, or has no splats.
pub(crate) fn person(folder: &Path, slot: usize, model: &str) -> anyhow::Result<SkinnedSplats> {
    let reading = || format!("the model {model}");
    let device = yoto_device::pick().device;
    let renderer = Renderer::load(folder, &device).with_context(reading)?;
    let person = renderer.skinned_splats(slot).with_context(reading)?;
    let tier = &renderer.config().tier;
    person.with_context(|| {
        format!(
            "the model's tier, {tier}, has no splats: train one with --tier splat, or make some of \
             this one with `yoto-lab distill`"
        )
    })
}
