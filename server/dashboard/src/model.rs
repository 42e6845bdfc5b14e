//! One model: people, curves, pictures, checkpoints, the measured trade-off, and jobs.

use super::asker::Asker;
use super::document::{self, Page};
use super::fault::Fault;
use super::job::{file_path, files, frame, metrics};
use super::names::Names;
use super::people::{captures_of, portrait};
use super::words::{ago, badge, bytes, name, page_of, told, whole};
use super::{curves, jobs, orders, progress, tradeoff};
use axum::extract::Path;
use maud::{Markup, html};
use tonic::{Code, Status};
use yoto_http::file_kind::FileKind;
use yoto_proto::v1::{
    Checkpoint, GetModelRequest, GetSubjectRequest, Job, JobKind, ListCheckpointsRequest,
    ListJobsRequest, Model, NamedObject, Subject, job,
};

/// Most trainings whose curves are drawn, most people with pictures, most checkpoints and most jobs.
const TRAININGS: i32 = 5;
const PEOPLE: usize = 24;
const CHECKPOINTS: i32 = 50;
const JOBS: i32 = 10;
/// Newest exports among which a player is looked for.
const EXPORTS: i32 = 4;
/// Most pictures of the newest render.
const PICTURES: usize = 8;

/// `/models/{id}`
pub async fn page(asker: Asker, Path(id): Path<String>) -> Result<Page, Fault> {
    let resource = format!("models/{id}");
    let request = GetModelRequest {
        name: resource.clone(),
    };
    let model = asker.services().models.get_model(asker.request(request));
    let model = model.await?.into_inner();
    let trainings = of_model(&asker, &resource, &[JobKind::Train], &[], TRAININGS).await?;
    let mut curve = Vec::new();
    for training in trainings.iter().rev() {
        curve.push(metrics(&asker, &training.name).await?);
    }
    // A training that waits, or has just begun, leaves the curve of the one before in front.
    while curve.len() > 1 && curve.last().is_some_and(Vec::is_empty) {
        curve.pop();
    }
    let recent = of_model(&asker, &resource, &[], &[], JOBS).await?;
    let checkpoints = checkpoints_of(&asker, &resource).await?;
    let people = people(&asker, &model).await?;
    let cards = cards(&asker, &model, &people).await?;
    let player = player(&asker, &resource).await?;
    let orders = orders::forms(&asker, &model, &people, player.is_some())?;
    let pictures = newest_pictures(&asker, &resource).await?;
    let tradeoff = tradeoff::of(&asker, &checkpoints).await?;
    let now = asker.now();
    let mut names = Names::of(&asker);
    let jobs = jobs::table(&recent, &mut names, now).await?;
    let running = trainings
        .iter()
        .find(|it| it.state() == job::State::Running);
    let title = told(&model.display_name);
    let percent = running
        .and_then(|it| it.progress.as_ref())
        .map(progress::percent);
    let title = percent.map_or_else(|| title.clone(), |it| format!("{it} % · {title}"));
    let body = html! {
        h1 { (name(&model.display_name)) " " (state(&model, running.is_some())) }
        div #now {
            @if let Some(job) = running {
                (progress::bar(job))
                p { a href=(page_of(&job.name)) { "The training" } }
            }
        }
        dl .facts {
            div { dt { "Tier" } dd { (told(&model.tier)) } }
            div { dt { "Variant" } dd { (told(&model.variant)) } }
            div { dt { "Made" } dd { (ago(now, model.create_time.as_ref())) } }
            @if let Some(best) = checkpoints.iter().find(|it| it.best) {
                div { dt { "Best checkpoint" } dd { "step " (whole(best.step)) @if let Some(psnr) = best.psnr { ", " (format!("{psnr:.2}")) " dB" } } }
            }
            div { dt { "Id" } dd { code { (id) } } }
        }
        p { a href={ "/models/" (id) "/report.html" } { "Report in one file" } }
        div #orders { (orders) }
        div #curves { @if curves::any(&curve) { h2 { "Curves" } (curves::curves(&curve)) } }
        h2 { "People" }
        div #people { (cards) }
        div #player { @if let Some(player) = player { (player) } }
        div #pictures { (pictures) }
        div #tradeoff { (tradeoff) }
        h2 { "Checkpoints" }
        (table(&checkpoints, now))
        h2 { "Jobs" }
        (jobs)
    };
    let events = format!("model={id}");
    Ok(document::live(&title, "/models", &events, body))
}

/// Whether a model is trained, or being trained.
fn state(model: &Model, running: bool) -> Markup {
    let trained = model.slots.iter().any(|it| it.trained);
    match (running, trained) {
        (true, _) => badge("busy", "training"),
        (false, true) => badge("good", "trained"),
        (false, false) => badge("calm", "not trained"),
    }
}

/// The newest checkpoints of a model.
pub(super) async fn checkpoints_of(asker: &Asker, model: &str) -> Result<Vec<Checkpoint>, Status> {
    let request = ListCheckpointsRequest {
        model: model.to_owned(),
        page_size: CHECKPOINTS,
        ..ListCheckpointsRequest::default()
    };
    let list = asker
        .services()
        .models
        .list_checkpoints(asker.request(request));
    Ok(list.await?.into_inner().checkpoints)
}

/// The newest jobs of a model.
pub(super) async fn of_model(
    asker: &Asker,
    model: &str,
    kinds: &[JobKind],
    states: &[job::State],
    most: i32,
) -> Result<Vec<Job>, Status> {
    let request = ListJobsRequest {
        model: model.to_owned(),
        kinds: kinds.iter().map(|&it| it.into()).collect(),
        states: states.iter().map(|&it| it.into()).collect(),
        page_size: most,
        ..ListJobsRequest::default()
    };
    let list = asker
        .services()
        .jobs
        .list_jobs(asker.request(request))
        .await?;
    Ok(list.into_inner().jobs)
}

/// The people of a model, and whether its newest checkpoint knows them.
pub(super) async fn people(asker: &Asker, model: &Model) -> Result<Vec<(Subject, bool)>, Status> {
    let mut found = Vec::new();
    for slot in model.slots.iter().take(PEOPLE) {
        let request = GetSubjectRequest {
            name: slot.subject.clone(),
        };
        match asker
            .services()
            .subjects
            .get_subject(asker.request(request))
            .await
        {
            Ok(subject) => found.push((subject.into_inner(), slot.trained)),
            // An erased person leaves an empty slot.
            Err(error) if error.code() == Code::NotFound => {}
            Err(error) => return Err(error),
        }
    }
    Ok(found)
}

/// The people of a model with pictures.
async fn cards(asker: &Asker, model: &Model, people: &[(Subject, bool)]) -> Result<Markup, Status> {
    let subjects: Vec<Subject> = people.iter().map(|it| it.0.clone()).collect();
    let captures = captures_of(asker, &subjects).await?;
    Ok(html! {
        @if people.is_empty() { p .empty { "Nobody yet: " code { "yoto model add-person" } " adds somebody." } }
        ul .cards {
            @for (subject, trained) in people {
                li { a .card href=(page_of(&subject.name)) {
                    (portrait(&subject.display_name, captures.get(&subject.name)))
                    span .title { (name(&subject.display_name)) }
                    @if *trained { (badge("good", "trained")) } @else { (badge("calm", "not trained")) }
                } }
            }
        }
        @if model.slots.len() > PEOPLE { p .detail { (model.slots.len() - PEOPLE) " more" } }
    })
}

/// The player of the newest export that has one.
async fn player(asker: &Asker, model: &str) -> Result<Option<Markup>, Status> {
    let exports = of_model(
        asker,
        model,
        &[JobKind::Export],
        &[job::State::Succeeded],
        EXPORTS,
    );
    for export in exports.await? {
        let files = files(asker, &export.name).await?;
        let id = export.name.trim_start_matches("jobs/");
        if let Some(file) = files
            .iter()
            .find(|it| FileKind::of(&it.file) == FileKind::Player)
        {
            return Ok(Some(html! {
                h2 { a href=(page_of(&export.name)) { "Player" } }
                (frame(id, &file.file))
            }));
        }
    }
    Ok(None)
}

/// Pictures of the newest render.
pub(super) async fn newest_pictures(asker: &Asker, model: &str) -> Result<Markup, Status> {
    let renders = of_model(
        asker,
        model,
        &[JobKind::Render],
        &[job::State::Succeeded],
        1,
    )
    .await?;
    let Some(render) = renders.first() else {
        return Ok(html! {});
    };
    let shown = files(asker, &render.name).await?;
    let is_picture = |it: &&NamedObject| matches!(FileKind::of(&it.file), FileKind::Picture(_));
    let id = render.name.trim_start_matches("jobs/");
    Ok(html! {
        h2 { a href=(page_of(&render.name)) { "Newest render" } }
        div .pictures {
            @for it in shown.iter().filter(is_picture).take(PICTURES) {
                a href=(file_path(id, &it.file)) {
                    img loading="lazy" src=(file_path(id, &it.file)) alt={ "Picture " (told(&it.file)) };
                }
            }
        }
    })
}

/// Checkpoints, one per row.
pub(super) fn table(checkpoints: &[Checkpoint], now: f64) -> Markup {
    html! {
        @if checkpoints.is_empty() { p .empty { "None yet." } }
        @else {
            div .scroll tabindex="0" role="group" aria-label="Table" { table {
                thead { tr { th { "Step" } th { "PSNR, dB" } th { "Image size" } th { "Bytes" } th { "Kept for" } th { "Saved" } } }
                tbody {
                    @for it in checkpoints {
                        tr {
                            th scope="row" { (whole(it.step)) @if it.best { " " (badge("good", "best")) } @for alias in &it.aliases { " " (badge("calm", alias)) } }
                            td { (curves::figure(it.psnr, 2)) }
                            td { @if it.image_size == 0 { "as filmed" } @else { (it.image_size) } }
                            td { (bytes(it.bytes)) }
                            td .text { (kept_for(it)) }
                            td { (ago(now, it.create_time.as_ref())) }
                        }
                    }
                }
            } }
        }
    }
}

/// Why a checkpoint is kept.
fn kept_for(checkpoint: &Checkpoint) -> String {
    match checkpoint.kept_for.is_empty() {
        true => "until the next one".to_owned(),
        false => checkpoint
            .kept_for
            .iter()
            .map(|it| told(it))
            .collect::<Vec<_>>()
            .join(", "),
    }
}
