//! Pictures in the text of a page.

use super::super::asker::Asker;
use super::super::files::whole;
use super::super::job::files;
use super::super::model::of_model;
use super::super::words::{bytes, told};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{Markup, html};
use sha2::{Digest, Sha256};
use tonic::{Code, Status};
use yoto_http::file_kind::FileKind;
use yoto_proto::names;
use yoto_proto::v1::{GetJobRequest, JobKind, job, job_spec};

/// Most bytes of all pictures of a page, which people send by mail.
const MOST: usize = 6 << 20;
/// Most pictures of a render.
const PICTURES: usize = 12;
/// Newest renders among which one that compares with filmed frames is looked for.
const RENDERS: i32 = 10;

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
    /// The picture in the object `name` as a `data:` URL; `None` if it does not exist or is too large for the page.
    ///
    /// # Errors
    /// When the service can't read it.
    pub async fn picture(&mut self, asker: &Asker, name: &str) -> Result<Option<String>, Status> {
        let FileKind::Picture(content_type) = FileKind::of(name) else {
            return Ok(None);
        };
        let picture = match whole(asker, name, MOST - self.bytes).await {
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

    /// What was left out.
    pub fn note(&self) -> Markup {
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

/// Whether a render shows the filmed frame beside each picture. Lists of jobs have no orders.
async fn compares(asker: &Asker, job: &str) -> Result<bool, Status> {
    let request = GetJobRequest {
        name: job.to_owned(),
    };
    let job = match asker.services().jobs.get_job(asker.request(request)).await {
        Ok(job) => job.into_inner(),
        // It was deleted meanwhile.
        Err(error) if error.code() == Code::NotFound => return Ok(false),
        Err(error) => return Err(error),
    };
    let order = job.spec.and_then(|it| it.kind);
    Ok(matches!(order, Some(job_spec::Kind::Render(it)) if it.compare))
}

/// Pictures of the newest render that compares with filmed frames, or else of the newest one.
///
/// # Errors
/// When the service can't read them.
pub(super) async fn of_newest_render(
    asker: &Asker,
    model: &str,
    inline: &mut Inline,
) -> Result<Markup, Status> {
    let done = [job::State::Succeeded];
    let renders = of_model(asker, model, &[JobKind::Render], &done, RENDERS).await?;
    let mut compared = None;
    for render in &renders {
        if compares(asker, &render.name).await? {
            compared = Some(render);
            break;
        }
    }
    let Some(render) = compared.or(renders.first()) else {
        return Ok(html! {});
    };
    let mut shown = Vec::new();
    let files = files(asker, &render.name).await?;
    let is_picture = |file: &str| matches!(FileKind::of(file), FileKind::Picture(_));
    // An animation repeats the pictures.
    let single = |file: &str| is_picture(file) && !file.starts_with("animation");
    let pictures: Vec<_> = files.iter().filter(|it| single(&it.file)).collect();
    let every = pictures.len().div_ceil(PICTURES).max(1);
    for it in pictures.into_iter().step_by(every) {
        let object = names::object(&render.name, &it.file);
        if let Some(source) = inline.picture(asker, &object).await? {
            shown.push((told(&it.file), source));
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
