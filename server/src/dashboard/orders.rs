//! Orders from a model's page: a training, and a player of one of its people.

use super::actions::{form, request_of, see, sent};
use super::asker::Asker;
use super::fault::Fault;
use super::query::Fields;
use super::words::{page_of, told};
use axum::body::Body;
use axum::extract::Path;
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use maud::{Markup, html};
use tonic::Status;
use yoto_proto::v1::job_service_server::JobService;
use yoto_proto::v1::{
    CreateJobRequest, ExportForm, ExportSpec, JobSpec, Model, Subject, TrainSpec, job_spec,
};

/// Minutes of a training unless the form says otherwise.
const MINUTES: u32 = 5;
/// Longest training that the form orders, minutes: a week.
const LONGEST: u32 = 7 * 24 * 60;

/// The forms of a model with these people; the flag of each says whether the model was trained with them.
///
/// # Errors
/// When no layer has told who asks.
pub fn forms(asker: &Asker, model: &Model, people: &[(Subject, bool)]) -> Result<Markup, Status> {
    let path = page_of(&model.name);
    let trained: Vec<&Subject> = people.iter().filter(|it| it.1).map(|it| &it.0).collect();
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
            details #play .act {
                summary { "Make a player…" }
                p { "A page that plays the person, in this browser and as one file." }
                (form(asker, &format!("{path}/player"), &[], html! {
                    label { "Person "
                        select name="subject" {
                            @for it in trained { option value=(it.name) { (told(&it.display_name)) } }
                        }
                    }
                    button { "Make it" }
                })?)
            }
        }
    })
}

/// Queues what the form asks for, and leads to its page.
async fn order(asker: &Asker, form: &Fields, kind: job_spec::Kind) -> Result<Response, Fault> {
    let request = CreateJobRequest {
        spec: Some(JobSpec { kind: Some(kind) }),
        request_id: request_of(form),
        ..CreateJobRequest::default()
    };
    let job = asker.jobs().create_job(asker.request(request)).await?;
    see(&page_of(&job.into_inner().name))
}

/// `POST /models/{id}/train`
pub async fn train(
    asker: Asker,
    Path(id): Path<String>,
    headers: HeaderMap,
    body: Body,
) -> Result<Response, Fault> {
    let form = sent(&asker, &headers, body).await?;
    let minutes = form.get("minutes").trim().parse::<u32>();
    let minutes = minutes.ok().filter(|it| (1..=LONGEST).contains(it));
    let minutes = minutes.ok_or_else(|| {
        let words = format!("a training takes 1 to {LONGEST} minutes, a whole number");
        Fault::of(StatusCode::BAD_REQUEST, words)
    })?;
    let spec = TrainSpec {
        model: format!("models/{id}"),
        seconds: 60.0 * f64::from(minutes),
        ..TrainSpec::default()
    };
    order(&asker, &form, job_spec::Kind::Train(spec)).await
}

/// `POST /models/{id}/player`
pub async fn player(
    asker: Asker,
    Path(id): Path<String>,
    headers: HeaderMap,
    body: Body,
) -> Result<Response, Fault> {
    let form = sent(&asker, &headers, body).await?;
    let spec = ExportSpec {
        model: format!("models/{id}"),
        subject: form.get("subject").to_owned(),
        form: ExportForm::Page.into(),
        ..ExportSpec::default()
    };
    order(&asker, &form, job_spec::Kind::Export(spec)).await
}
