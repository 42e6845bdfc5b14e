//! Pages that play trained people.

use anyhow::{Context, bail};
use std::path::Path;
use yoto_client::YotoClient;
use yoto_proto::v1::export_motion::Motion;
use yoto_proto::v1::{
    CaptureMotion, ExportForm, ExportMotion, ExportSpec, Model, Subject, job_result,
};
use yoto_terminal::progress::ProgressDisplay;

/// Has the people of `pages` in `model` exported, each to a page at its path with the motions of all of their captures,
/// their own first.
///
/// # Errors
/// The first job that fails or page that can't be written.
pub(crate) async fn write_pages(
    client: &YotoClient,
    model: &Model,
    pages: &[(&Subject, &Path)],
) -> anyhow::Result<()> {
    for (index, (subject, path)) in pages.iter().enumerate() {
        let drivers = own_first(pages, index).map(|(driver, _)| ExportMotion {
            motion: Some(Motion::Capture(CaptureMotion {
                driver: driver.name.clone(),
                ..CaptureMotion::default()
            })),
            ..ExportMotion::default()
        });
        let spec = ExportSpec {
            model: model.name.clone(),
            subject: subject.name.clone(),
            form: ExportForm::Page.into(),
            motions: drivers.collect(),
            ..ExportSpec::default()
        };
        let name = client.export(spec).await?.name;
        let mut display = ProgressDisplay::new(format!("page of {}", subject.display_name));
        let shown = |job: &_| display.job(job);
        let job = client.wait_for_job(&name, shown).await?;
        display.clear();
        let Some(job_result::Kind::Export(result)) = job.result.and_then(|it| it.kind) else {
            bail!("{name} succeeded without the result of an export");
        };
        let files = client.exported(&name, &result).await?;
        let page = files
            .first()
            .with_context(|| format!("{name} has no file"))?;
        std::fs::write(path, page).with_context(|| format!("writing {}", path.display()))?;
    }
    Ok(())
}

/// All of `them`, beginning with the one at `own`.
fn own_first<T>(them: &[T], own: usize) -> impl Iterator<Item = &T> {
    let others = them
        .iter()
        .enumerate()
        .filter(move |(index, _)| *index != own);
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
