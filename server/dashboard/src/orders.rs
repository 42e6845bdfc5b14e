//! Orders from a model's page: a training, a film and a player of one of its people.

use super::actions::{SentForm, form, request_of, see};
use super::asker::Asker;
use super::page_error::PageError;
use super::query::Fields;
use super::words::{page_of, told};
use axum::extract::Path;
use axum::http::StatusCode;
use axum::response::Response;
use maud::{Markup, html};
use tonic::Status;
use yoto_proto::v1::{
    Actor, CaptureMotion, CreateJobRequest, ExportForm, ExportSpec, JobSpec, Model, RenderSpec,
    Scene, SceneCamera, SceneOrbit, Subject, TrainSpec, actor, job_spec, render_spec, scene_camera,
};
use yoto_store::Person;

/// Minutes of a training unless the form says otherwise.
const MINUTES: u32 = 5;
/// Longest training that the form orders, minutes: a week.
const LONGEST: u32 = 7 * 24 * 60;
/// Longest film that the form orders, seconds.
const LONGEST_FILM: f64 = 60.0;
/// Heights of films to choose from, the one unless the form says otherwise, and the largest, pixels.
const SIZES: [u32; 4] = [256, 512, 768, 1024];
const SIZE: u32 = 512;
const LARGEST: u32 = 2048;
/// Level of the background, on which a shadow shows.
const WALL: f32 = 0.85;

/// The forms of a model with these people; the flag of each says whether the model was trained with them. `plays` says whether the
/// page has a player, whose camera becomes that of a film.
///
/// # Errors
/// When no layer has told who asks.
pub(crate) fn forms(
    asker: &Asker,
    model: &Model,
    people: &[(Person, bool)],
    plays: bool,
) -> Result<Markup, Status> {
    let path = page_of(&model.name);
    let trained: Vec<&Subject> = people
        .iter()
        .filter(|it| it.1)
        .map(|it| &it.0.subject)
        .collect();
    Ok(html! {
        @if !people.is_empty() {
            details #train .act {
                summary { "Train…" }
                (form(asker, &format!("{path}/train"), &[], html! {
                    label { "Minutes " input name="minutes" type="number" min="1" max=(LONGEST) value=(MINUTES) required; }
                    button { "Train" }
                })?)
            }
        }
        @if !trained.is_empty() {
            details #film .act {
                summary { "Render a film…" }
                p { "A person moves as they were filmed, or as somebody else was, before a camera of yours." }
                p #camera { @if plays { "Drag the player on this page: the camera of the film follows." } }
                (form(asker, &format!("{path}/film"), &[], html! {
                    label { "Person " (choice("subject", trained.iter().copied(), None)) }
                    label { "Motion of " (choice("driver", people.iter().map(|it| &it.0.subject), Some("the person's own capture"))) }
                    label { "Camera to the right, degrees " input name="azimuth" type="number" min="-180" max="180" value="0" required; }
                    label { "Camera above the ground, degrees " input name="elevation" type="number" min="-80" max="80" value="10" required; }
                    label { "It orbits by, degrees " input name="sweep" type="number" min="-3600" max="3600" value="0" required; }
                    label { "Seconds " input name="seconds" type="number" min="1" max=(LONGEST_FILM) value="4" required; }
                    label { "Height, pixels "
                        select name="size" { @for size in SIZES { option value=(size) selected[size == SIZE] { (size) } } }
                    }
                    button { "Render" }
                })?)
            }
            details #play .act {
                summary { "Make a player…" }
                p { "A page that plays the person, in this browser and as one file." }
                (form(asker, &format!("{path}/player"), &[], html! {
                    label { "Person " (choice("subject", trained.iter().copied(), None)) }
                    button { "Make it" }
                })?)
            }
        }
    })
}

/// A list of people to choose from; `none` stands for nobody.
fn choice<'a>(
    field: &str,
    people: impl Iterator<Item = &'a Subject>,
    none: Option<&str>,
) -> Markup {
    html! {
        select name=(field) {
            @if let Some(words) = none { option value="" { (words) } }
            @for it in people { option value=(it.name) { (told(&it.display_name)) } }
        }
    }
}

/// A number of a form.
fn number(form: &Fields, field: &str, least: f64, most: f64) -> Result<f64, PageError> {
    let number = form.get(field).trim().parse::<f64>().ok();
    let number = number.filter(|it| (least..=most).contains(it));
    number.ok_or_else(|| {
        let words = format!("{field} is a number from {least} to {most}");
        PageError::of(StatusCode::BAD_REQUEST, words)
    })
}

/// The minutes of a training in a form, 1 to `longest`.
///
/// # Errors
/// When it is another text.
pub(crate) fn minutes(form: &Fields, longest: u32) -> Result<u32, PageError> {
    let minutes = form.get("minutes").trim().parse::<u32>();
    let minutes = minutes.ok().filter(|it| (1..=longest).contains(it));
    minutes.ok_or_else(|| {
        let words = format!("a training takes 1 to {longest} minutes, a whole number");
        PageError::of(StatusCode::BAD_REQUEST, words)
    })
}

/// Queues what the form asks for, and leads to its page.
///
/// # Errors
/// Those of `CreateJob`.
pub(crate) async fn order(
    asker: &Asker,
    form: &Fields,
    kind: job_spec::Kind,
) -> Result<Response, PageError> {
    let request = CreateJobRequest {
        spec: Some(JobSpec { kind: Some(kind) }),
        request_id: request_of(form),
        ..CreateJobRequest::default()
    };
    let job = asker
        .services()
        .jobs
        .create_job(asker.request(request))
        .await?;
    see(&page_of(&job.into_inner().name))
}

/// `POST /models/{id}/train`
pub(crate) async fn train(
    asker: Asker,
    Path(id): Path<String>,
    SentForm(form): SentForm,
) -> Result<Response, PageError> {
    let spec = TrainSpec {
        model: format!("models/{id}"),
        seconds: 60.0 * f64::from(minutes(&form, LONGEST)?),
        ..TrainSpec::default()
    };
    order(&asker, &form, job_spec::Kind::Train(spec)).await
}

/// `POST /models/{id}/film`
pub(crate) async fn film(
    asker: Asker,
    Path(id): Path<String>,
    SentForm(form): SentForm,
) -> Result<Response, PageError> {
    let size = number(&form, "size", 16.0, f64::from(LARGEST))? as u32;
    let motion = CaptureMotion {
        driver: form.get("driver").to_owned(),
        ..CaptureMotion::default()
    };
    let orbit = SceneOrbit {
        azimuth: number(&form, "azimuth", -180.0, 180.0)?,
        elevation: number(&form, "elevation", -80.0, 80.0)?,
        sweep: number(&form, "sweep", -3600.0, 3600.0)?,
        ..SceneOrbit::default()
    };
    let scene = Scene {
        actors: vec![Actor {
            subject: form.get("subject").to_owned(),
            motion: Some(actor::Motion::Capture(motion)),
            ..Actor::default()
        }],
        camera: Some(SceneCamera {
            path: Some(scene_camera::Path::Orbit(orbit)),
        }),
        width: size * 3 / 4,
        height: size,
        seconds: number(&form, "seconds", 0.1, LONGEST_FILM)?,
        shadow: true,
        ..Scene::default()
    };
    let spec = RenderSpec {
        model: format!("models/{id}"),
        what: Some(render_spec::What::Scene(scene)),
        background: vec![WALL; 3],
        animate: true,
        ..RenderSpec::default()
    };
    order(&asker, &form, job_spec::Kind::Render(spec)).await
}

/// `POST /models/{id}/player`
pub(crate) async fn player(
    asker: Asker,
    Path(id): Path<String>,
    SentForm(form): SentForm,
) -> Result<Response, PageError> {
    let spec = ExportSpec {
        model: format!("models/{id}"),
        subject: form.get("subject").to_owned(),
        form: ExportForm::Page.into(),
        ..ExportSpec::default()
    };
    order(&asker, &form, job_spec::Kind::Export(spec)).await
}
