//! A model in one file, to send to somebody: whom it has, how it was trained, what it is worth, and how long its jobs ran.
//!
//! The file needs nothing else and runs nothing: its style and its pictures are in it, and its policy allows no script. What is
//! told is what the pages tell, by the same parts.

mod cost;
mod inline;
mod quality;

use super::asker::Asker;
use super::assets::{ICON, STYLE};
use super::curves::{self, figure};
use super::model::{self, of_model, split};
use super::page_error::PageError;
use super::people::portrayed;
use super::person::agreed;
use super::words::{ago, badge, count, job_state, name, short, told, whole};
use super::{findings, outcome, tradeoff};
use axum::extract::Path;
use axum::http::header::{CONTENT_DISPOSITION, CONTENT_SECURITY_POLICY, CONTENT_TYPE};
use axum::response::{IntoResponse, Response};
use inline::Inline;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use prost_types::Timestamp;
use tonic::Status;
use yoto_proto::keys::THUMBNAIL;
use yoto_proto::manifest::files::PREVIEW;
use yoto_proto::progress::duration;
use yoto_proto::text::visible;
use yoto_proto::v1::{
    Capture, Checkpoint, Consent, Job, MetricPoint, TrainResult, job, job_result,
};
use yoto_store::{JobKind, Person};

/// Most trainings and most jobs that are told of.
const TRAININGS: u32 = 20;
const JOBS: u32 = 1000;
/// Newest evaluations among which one with figures is looked for.
const EVALUATIONS: u32 = 4;

/// `/models/{id}/report.html`
pub(crate) async fn page(asker: Asker, Path(id): Path<String>) -> Result<Response, PageError> {
    let resource = format!("models/{id}");
    let model = asker.model(&resource).await?;
    let (backend, tenant) = (asker.backend(), asker.tenant()?);
    let mut checkpoints = backend.checkpoints(&tenant, &resource).await?;
    checkpoints.truncate(model::CHECKPOINTS);
    let done = [job::State::Succeeded];
    let groups = [
        of_model(&id, &[JobKind::Train], &[], TRAININGS),
        of_model(&id, &[JobKind::Evaluate], &done, EVALUATIONS),
        of_model(&id, &[], &[], JOBS),
        inline::renders(&id),
    ];
    let lists = backend.jobs(&tenant, &groups).await?;
    let [trainings, evaluations, jobs, renders] = split(lists);
    let mut figures = curves::of(&asker, trainings.iter().rev()).await?;
    figures.retain(|it: &Vec<MetricPoint>| !it.is_empty());
    let people = model::people(&asker, &model).await?;
    let told_of = people.len();
    let mut inline = Inline::default();
    let now = asker.now();
    let people = shown_people(&asker, now, &people, &mut inline).await?;
    let best = checkpoints.iter().find(|it| it.best);
    let preview = match best {
        Some(best) => inline.of_checkpoint(&asker, best, PREVIEW).await?,
        None => None,
    };
    let pictures = inline::of_newest_render(&asker, &renders, &mut inline).await?;
    let tradeoff = tradeoff::of(&asker, &checkpoints).await?;
    let newest = trainings.iter().find_map(result);
    let body = html! {
        h1 { (name(&model.display_name)) }
        p .lead {
            "A model of " (people_of(model.slots.len())) ", of the tier "
            (told(&model.tier)) " and the variant " (told(&model.variant)) "."
        }
        p .detail { "Written on " (date(now)) ": times are counted back from then." }
        (facts(best, newest, now))
        @if let Some(source) = preview {
            h2 { "Held-out frames" }
            p .detail { "As filmed on the left, and as the best checkpoint renders them on the right." }
            img .preview alt="Held-out frames beside their renders" src=(source);
        }
        h2 { "People" }
        (people)
        @if model.slots.len() > told_of { p .detail { (model.slots.len() - told_of) " more, or erased." } }
        h2 { "Trainings" }
        (table(&trainings, now))
        @if let Some(result) = newest { (outcome::train_notes(result)) }
        @if curves::any(&figures) { h2 { "Curves" } (curves::curves(&figures)) }
        h2 { "Quality" }
        (quality::section(&evaluations, &model.variant))
        (pictures)
        (tradeoff)
        h2 { "Checkpoints" }
        (model::table(&checkpoints, now))
        h2 { "Cost" }
        (cost::section(&jobs, &checkpoints, now))
        (inline.note())
        p .detail { "Written by yoto " (env!("CARGO_PKG_VERSION")) ", of the model " code { (told(&id)) } "." }
    };
    Ok(file(&model.display_name, &body))
}

/// The document as an answer: nothing but its own style and the pictures in it takes part.
fn file(title: &str, body: &Markup) -> Response {
    let style = STYLE.content();
    let policy = format!(
        "default-src 'none'; style-src '{}'; img-src data:; base-uri 'none'; form-action 'none'",
        inline::digest(style)
    );
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="content-security-policy" content=(policy);
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (told(title)) " · yoto" }
                // Without an icon of its own, a browser would request `/favicon.ico`, which does not exist.
                link rel="icon" href=(inline::data(ICON.content_type(), ICON.content().as_bytes()));
                style { (PreEscaped(style)) }
            }
            body { main { (body) } }
        }
    };
    let headers = [
        (CONTENT_TYPE, "text/html; charset=utf-8".to_owned()),
        (CONTENT_SECURITY_POLICY, policy),
        (
            CONTENT_DISPOSITION,
            "inline; filename=\"report.html\"".to_owned(),
        ),
    ];
    (headers, page.into_string()).into_response()
}

/// The result of a training that has one.
fn result(job: &Job) -> Option<&TrainResult> {
    match &job.result.as_ref()?.kind {
        Some(job_result::Kind::Train(result)) => Some(result),
        _ => None,
    }
}

fn facts(best: Option<&Checkpoint>, newest: Option<&TrainResult>, now: f64) -> Markup {
    html! {
        @if best.is_none() { p .empty { "It is not trained." } }
        dl .facts {
            @if let Some(best) = best {
                div { dt { "Best checkpoint" } dd { "step " (whole(best.step)) ", " (ago(now, best.create_time.as_ref())) } }
                div { dt { "Held-out PSNR" } dd { (figure(best.psnr, 2)) " dB" } }
            }
            @if let Some(it) = newest {
                div { dt { "In the box around the person" } dd { (figure(it.psnr_mask_box, 2)) " dB" } }
                div { dt { "Held-out frames" } dd { (it.held_out) } }
                div { dt { "Parameters" } dd { (whole(it.parameters)) } }
                div { dt { "Objective" } dd { (told(&it.objective)) } }
                @if let Some(guessed) = it.guessed {
                    div { dt { "Surface that no frame shows" } dd { (figure(Some(100.0 * guessed), 0)) " %, with guessed colours" } }
                }
            }
        }
    }
}

/// The people, with what they agree to and what the check of their captures has found.
async fn shown_people(
    asker: &Asker,
    now: f64,
    people: &[(Person, bool)],
    inline: &mut Inline,
) -> Result<Markup, Status> {
    let names: Vec<&str> = people.iter().map(|it| &*it.0.subject.name).collect();
    let consents = asker.backend().consents(&asker.tenant()?, &names).await?;
    let mut sections = Vec::new();
    for (person, trained) in people {
        let subject = &person.subject;
        let capture = portrayed(person);
        let consents: Vec<&Consent> = consents
            .iter()
            .filter(|it| it.subject == subject.name)
            .collect();
        let (mut picture, mut report) = (None, None);
        if let Some(portrait) = &person.portrait {
            picture = match portrait.object(THUMBNAIL) {
                Some(object) => inline.picture(asker, THUMBNAIL, object).await?,
                None => None,
            };
            report = findings::read(asker, portrait).await?;
        }
        sections.push(html! {
            section .panel {
                div .row {
                    @if let Some(source) = picture { img .portrait width="96" height="96" alt={ "Picture of " (told(&subject.display_name)) } src=(source); }
                    div {
                        h3 {
                            (name(&subject.display_name)) " "
                            @if *trained { (badge("good", "trained")) } @else { (badge("calm", "not trained")) }
                            @if let Some(report) = &report { " check: " (report.grade()) }
                        }
                        @if let Some(capture) = capture { p .detail { (filmed(capture)) } }
                        @for consent in &consents { p .detail { "Consent: " (agreed(now, consent)) } }
                        @if !subject.consent_note.is_empty() { p .detail { "Consent: " (visible(&subject.consent_note)) } }
                    }
                }
                @if let Some(report) = &report { details { summary { "What the check has found" } (report.table()) } }
            }
        });
    }
    Ok(html! {
        @if sections.is_empty() { p .empty { "Nobody." } }
        @for section in sections { (section) }
    })
}

fn people_of(number: usize) -> String {
    match number {
        1 => "1 person".to_owned(),
        number => format!("{} people", whole(number as u64)),
    }
}

fn filmed(capture: &Capture) -> String {
    let frames = count(capture.frames.into(), "frame");
    let (width, height) = (capture.width, capture.height);
    format!(
        "Capture {} of {frames} of {width} × {height} pixels",
        short(&capture.name)
    )
}

fn table(trainings: &[Job], now: f64) -> Markup {
    html! {
        @if trainings.is_empty() { p .empty { "None." } }
        @else {
            div .scroll tabindex="0" role="group" aria-label="Table" { table {
                thead { tr { th { "Queued" } th { "State" } th { "Steps" } th { "Time" } th { "Image size" } th { "PSNR, dB" } th { "In the box, dB" } th { "Device" } } }
                tbody { @for job in trainings {
                    @let it = result(job);
                    tr {
                        td { (ago(now, job.create_time.as_ref())) }
                        td { (job_state(job)) }
                        td { (it.map_or_else(|| "–".to_owned(), |it| whole(it.steps))) }
                        td { (it.map_or_else(|| "–".to_owned(), |it| duration(it.train_seconds))) }
                        td { (it.map_or_else(|| "–".to_owned(), size)) }
                        td { (figure(it.and_then(|it| it.psnr), 2)) }
                        td { (figure(it.and_then(|it| it.psnr_mask_box), 2)) }
                        td .text { (it.map_or_else(|| "–".to_owned(), |it| told(&it.device))) }
                    }
                } }
            } }
        }
    }
}

fn size(result: &TrainResult) -> String {
    match result.image_size {
        0 => "as filmed".to_owned(),
        size => size.to_string(),
    }
}

/// The day of a time, seconds since 1970, in universal time.
fn date(now: f64) -> String {
    let time = Timestamp {
        seconds: now as i64,
        nanos: 0,
    };
    time.to_string().chars().take(10).collect()
}
