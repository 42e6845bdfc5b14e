//! What a training has made, outside of the service.

use crate::api::YotoClient;
use crate::capture_dir::{named, read_track};
use anyhow::Context;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use yoto_avatar::render::{Renderer, SkinnedSplats};
use yoto_export::page;
use yoto_export::source::{Source, clips};
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

/// A page to write.
pub(crate) struct Page<'a> {
    /// The person.
    pub subject: &'a Subject,
    /// The folder of their own capture, whose motion the page begins with.
    pub own: &'a Path,
    /// The file.
    pub path: PathBuf,
}

/// Writes `pages` of people in the best checkpoint of `model`, each with the motions of all of their captures.
///
/// # Errors
/// The first failure.
pub(crate) async fn write_pages(
    client: &YotoClient,
    model: &Model,
    pages: &[Page<'_>],
) -> anyhow::Result<()> {
    let model = client.find_model(&model.display_name).await?;
    let files = fetch(client, &model, None).await?;
    let motion = |page: &Page<'_>| -> anyhow::Result<Source> {
        Ok(Source::track(&named(page.own), &read_track(page.own)?)?)
    };
    let motions = pages.iter().map(motion);
    let motions: Vec<Source> = motions.collect::<anyhow::Result<_>>()?;
    for (place, page) in pages.iter().enumerate() {
        let name = &page.subject.display_name;
        let slot = model
            .slots
            .iter()
            .find(|slot| slot.subject == page.subject.name);
        let slot =
            slot.with_context(|| format!("{} has no slot for {name}", model.display_name))?;
        let person = person(files.path(), slot.slot as usize, &model.display_name)?;
        let moves = clips(own_first(&motions, place), &person.skeleton)?;
        let html = page::page(name, &person, &moves).context("the motion of a capture")?;
        let path = &page.path;
        std::fs::write(path, html).with_context(|| format!("writing {}", path.display()))?;
    }
    Ok(())
}

/// All of `them`, beginning with the one at `own`.
fn own_first<T>(them: &[T], own: usize) -> impl Iterator<Item = &T> {
    let others = them
        .iter()
        .enumerate()
        .filter(move |(place, _)| *place != own);
    them.get(own).into_iter().chain(others.map(|(_, it)| it))
}

#[cfg(test)]
mod tests {
    use super::own_first;

    #[test]
    fn a_page_begins_with_its_person_s_own_motion() {
        let order = |own| {
            own_first(&["ada", "bob", "cy"], own)
                .copied()
                .collect::<Vec<_>>()
        };
        assert_eq!(order(0), ["ada", "bob", "cy"]);
        assert_eq!(order(1), ["bob", "ada", "cy"]);
        assert_eq!(order(2), ["cy", "ada", "bob"]);
    }
}
