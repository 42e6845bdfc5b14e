//! Pictures in the text of a page.

use super::super::asker::Asker;
use super::super::model::of_model;
use super::super::words::{bytes, told};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{Markup, html};
use sha2::{Digest, Sha256};
use tonic::{Code, Status};
use yoto_http::file_kind::FileKind;
use yoto_http::job_files::files_of_result;
use yoto_proto::v1::{Checkpoint, Job, ObjectRef, job, job_spec};
use yoto_store::{JobGroup, JobKind};

/// Most bytes of all pictures of a page, which people send by mail.
const MOST: usize = 6 << 20;
/// Most pictures of a render.
const PICTURES: usize = 12;
/// Newest renders among which one that compares with filmed frames is looked for.
const RENDERS: u32 = 10;

/// A file as a `data:` URL.
pub(super) fn data(content_type: &str, bytes: &[u8]) -> String {
    format!("data:{content_type};base64,{}", STANDARD.encode(bytes))
}

/// The pictures of a page so far.
#[derive(Debug, Default)]
pub(super) struct Inline {
    bytes: usize,
    left_out: usize,
}

impl Inline {
    /// The picture in `object`, whose file is called `file`, as a `data:` URL; `None` if it does not exist or is too large for
    /// the page.
    ///
    /// # Errors
    /// When the service can't read it.
    pub(super) async fn picture(
        &mut self,
        asker: &Asker,
        file: &str,
        object: &ObjectRef,
    ) -> Result<Option<String>, Status> {
        let FileKind::Picture(content_type) = FileKind::of(file) else {
            return Ok(None);
        };
        let picture = match asker.backend().object(object, MOST - self.bytes).await {
            Ok(Some(picture)) => picture,
            Ok(None) => {
                self.left_out += 1;
                return Ok(None);
            }
            // It was deleted meanwhile.
            Err(error) if error.code() == Code::NotFound => return Ok(None),
            Err(error) => return Err(error),
        };
        self.bytes += picture.len();
        Ok(Some(data(content_type, &picture)))
    }

    /// The picture in a file of a checkpoint; `None` as above, or if the checkpoint has no such file.
    ///
    /// # Errors
    /// When the service can't read it.
    pub(super) async fn of_checkpoint(
        &mut self,
        asker: &Asker,
        checkpoint: &Checkpoint,
        file: &str,
    ) -> Result<Option<String>, Status> {
        match asker.backend().file_of(checkpoint, file).await {
            Ok(Some(object)) => self.picture(asker, file, &object).await,
            Ok(None) => Ok(None),
            // It was deleted meanwhile.
            Err(error) if error.code() == Code::NotFound => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// What was left out.
    pub(super) fn note(&self) -> Markup {
        html! {
            @if self.left_out > 0 {
                p .detail { (self.left_out) " pictures are left out: a report has at most " (bytes(MOST as u64)) " of them." }
            }
        }
    }
}

/// The hash of a style sheet for a policy.
pub(super) fn digest(style: &str) -> String {
    format!(
        "sha256-{}",
        STANDARD.encode(Sha256::digest(style.as_bytes()))
    )
}

/// Whether a render shows the filmed frame beside each picture.
fn compares(job: &Job) -> bool {
    let order = job.spec.as_ref().and_then(|it| it.kind.as_ref());
    matches!(order, Some(job_spec::Kind::Render(it)) if it.compare)
}

/// The renders among which [`of_newest_render`] chooses, with their orders.
pub(super) fn renders(model_id: &str) -> JobGroup {
    JobGroup {
        full: true,
        ..of_model(
            model_id,
            &[JobKind::Render],
            &[job::State::Succeeded],
            RENDERS,
        )
    }
}

/// Pictures of the newest of `renders` that compares with filmed frames, or else of the newest one.
///
/// # Errors
/// When the service can't read them.
pub(super) async fn of_newest_render(
    asker: &Asker,
    renders: &[Job],
    inline: &mut Inline,
) -> Result<Markup, Status> {
    let compared = renders.iter().find(|it| compares(it));
    let Some(render) = compared.or(renders.first()) else {
        return Ok(html! {});
    };
    let mut shown = Vec::new();
    let files = files_of_result(render);
    let is_picture = |file: &str| matches!(FileKind::of(file), FileKind::Picture(_));
    // An animation repeats the pictures.
    let single = |file: &str| is_picture(file) && !file.starts_with("animation");
    let pictures: Vec<_> = files.iter().filter(|it| single(&it.0)).collect();
    let every = pictures.len().div_ceil(PICTURES).max(1);
    for (file, object) in pictures.into_iter().step_by(every) {
        if let Some(source) = inline.picture(asker, file, object).await? {
            shown.push((told(file), source));
        }
    }
    Ok(html! {
        @if !shown.is_empty() {
            h2 { "Pictures" }
            p .detail {
                @if compared.is_some() { "The filmed frame is to the left of the rendered one." }
                @else { "Rendered pictures; " code { "yoto render --compare truth" } " puts the filmed frame beside each." }
            }
            div .pictures { @for (file, source) in shown { img alt={ "Picture " (file) } src=(source); } }
        }
    })
}
