//! What a training has made, outside of the service.

use super::clips;
use crate::api::YotoClient;
use anyhow::Context;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use yoto_avatar::render::{Renderer, SkinnedSplats};
use yoto_export::page;
use yoto_proto::v1::{Model, Subject};

/// The files of a checkpoint of `model` at a `step`, or of the best one.
///
/// # Errors
/// If there is none, or it can't be fetched.
pub(crate) async fn fetch(
    client: &YotoClient,
    model: &Model,
    step: Option<u64>,
) -> anyhow::Result<TempDir> {
    let checkpoint = client.checkpoint_name(model, step).await?;
    let files = tempfile::tempdir().context("making a temporary folder")?;
    let objects = client.list_objects(&checkpoint).await?;
    client
        .fetch_objects(&objects, files.path(), &mut |_| ())
        .await?;
    Ok(files)
}

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
             this one with `yoto distill`"
        )
    })
}

/// Writes a page of each of the `people` in the best checkpoint of `model` to the path beside them, with the
/// motions of the captures in `folders`.
///
/// # Errors
/// The first failure.
pub(crate) async fn pages(
    client: &YotoClient,
    model: &Model,
    people: &[(&Subject, PathBuf)],
    folders: &[PathBuf],
) -> anyhow::Result<()> {
    let model = client.find_model(&model.display_name).await?;
    let files = fetch(client, &model, None).await?;
    let tracks: Vec<_> = folders
        .iter()
        .map(|folder| clips::read_track(folder))
        .collect::<anyhow::Result<_>>()?;
    for (subject, path) in people {
        let name = &subject.display_name;
        let slot = model.slots.iter().find(|slot| slot.subject == subject.name);
        let slot =
            slot.with_context(|| format!("{} has no slot for {name}", model.display_name))?;
        let person = person(files.path(), slot.slot as usize, &model.display_name)?;
        let mut moves = folders
            .iter()
            .zip(&tracks)
            .map(|(folder, track)| clips::clip(folder, track, &person.skeleton))
            .collect::<anyhow::Result<Vec<_>>>()?;
        clips::tell_apart(&mut moves);
        let page = page::page(name, &person, &moves).context("the motion of a capture")?;
        std::fs::write(path, page).with_context(|| format!("writing {}", path.display()))?;
    }
    Ok(())
}
