//! One model: people, curves, pictures, checkpoints, the measured trade-off, and jobs.

use super::asker::Asker;
use super::document::{self, Page};
use super::job::{file_path, frame};
use super::names::Names;
use super::page_error::PageError;
use super::people::{portrait, portrayed};
use super::words::{ago, badge, bytes, name, page_of, told, whole};
use super::{curves, jobs, orders, progress, tradeoff};
use axum::extract::Path;
use maud::{Markup, html};
use tonic::Status;
use yoto_http::file_kind::FileKind;
use yoto_http::job_files::files_of_result;
use yoto_proto::v1::{Checkpoint, Job, Model, job};
use yoto_store::{JobFilter, JobGroup, JobKind, Person};

/// Most trainings whose curves are drawn, most people with pictures, most checkpoints and most jobs.
const TRAININGS: u32 = 5;
const PEOPLE: usize = 24;
pub(super) const CHECKPOINTS: usize = 50;
const JOBS: u32 = 10;
/// Newest exports among which a player is looked for.
const EXPORTS: u32 = 4;
/// Most pictures of the newest render.
const PICTURES: usize = 8;

/// `/models/{id}`
pub(crate) async fn page(asker: Asker, Path(id): Path<String>) -> Result<Page, PageError> {
    let resource = format!("models/{id}");
    let model = asker.model(&resource).await?;
    let (backend, tenant) = (asker.backend(), asker.tenant()?);
    let groups = [
        of_model(&id, &[JobKind::Train], &[], TRAININGS),
        JobGroup {
            positions: true,
            ..of_model(&id, &[], &[], JOBS)
        },
        of_model(&id, &[JobKind::Export], &[job::State::Succeeded], EXPORTS),
        of_model(&id, &[JobKind::Render], &[job::State::Succeeded], 1),
    ];
    let lists = backend.jobs(&tenant, &groups).await?;
    let [trainings, recent, exports, renders] = split(lists);
    let mut curve = curves::of(&asker, trainings.iter().rev()).await?;
    // A training that waits, or has just begun, leaves the curve of the one before in front.
    while curve.len() > 1 && curve.last().is_some_and(Vec::is_empty) {
        curve.pop();
    }
    let mut checkpoints = backend.checkpoints(&tenant, &resource).await?;
    checkpoints.truncate(CHECKPOINTS);
    let people = people(&asker, &model).await?;
    let cards = cards(&model, &people);
    let player = player(&exports);
    let orders = orders::forms(&asker, &model, &people, player.is_some())?;
    let pictures = newest_pictures(renders.first());
    let tradeoff = tradeoff::of(&asker, &checkpoints).await?;
    let now = asker.now();
    // All of its jobs are about it.
    let names = Names::of(&resource, &model.display_name);
    let jobs = jobs::table(&recent, &names, now);
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

/// The newest jobs of the model with this id.
pub(super) fn of_model(id: &str, kinds: &[JobKind], states: &[job::State], most: u32) -> JobGroup {
    JobGroup {
        filter: JobFilter {
            model_id: Some(id.to_owned()),
            kinds: kinds.to_vec(),
            states: states.to_vec(),
            ..JobFilter::default()
        },
        most,
        ..JobGroup::default()
    }
}

/// The lists of as many groups.
pub(super) fn split<const N: usize>(lists: Vec<Vec<Job>>) -> [Vec<Job>; N] {
    let mut lists = lists.into_iter();
    [(); N].map(|()| lists.next().unwrap_or_default())
}

/// The people of a model, and whether its newest checkpoint knows them. An erased person leaves an empty slot.
pub(super) async fn people(asker: &Asker, model: &Model) -> Result<Vec<(Person, bool)>, Status> {
    let slots = model.slots.iter().take(PEOPLE);
    let names: Vec<&str> = slots.clone().map(|it| &*it.subject).collect();
    let tenant = asker.tenant()?;
    let mut found = asker.backend().people(&tenant, &names).await?;
    let people = slots.filter_map(|slot| Some((found.remove(&slot.subject)?, slot.trained)));
    Ok(people.collect())
}

/// The people of a model with pictures.
fn cards(model: &Model, people: &[(Person, bool)]) -> Markup {
    html! {
        @if people.is_empty() { p .empty { "Nobody yet: " code { "yoto model add-person" } " adds somebody." } }
        ul .cards {
            @for (person, trained) in people {
                @let subject = &person.subject;
                li { a .card href=(page_of(&subject.name)) {
                    (portrait(&subject.display_name, portrayed(person)))
                    span .title { (name(&subject.display_name)) }
                    @if *trained { (badge("good", "trained")) } @else { (badge("calm", "not trained")) }
                } }
            }
        }
        @if model.slots.len() > PEOPLE { p .detail { (model.slots.len() - PEOPLE) " more" } }
    }
}

/// The player of the newest of these exports that has one.
fn player(exports: &[Job]) -> Option<Markup> {
    exports.iter().find_map(|export| {
        let files = files_of_result(export).into_iter();
        let mut players = files.filter(|it| FileKind::of(&it.0) == FileKind::Player);
        let (file, _) = players.next()?;
        Some(html! {
            h2 { a href=(page_of(&export.name)) { "Player" } }
            (frame(export.name.trim_start_matches("jobs/"), &file))
        })
    })
}

/// Pictures of the newest render, if there is one.
pub(super) fn newest_pictures(render: Option<&Job>) -> Markup {
    let Some(render) = render else {
        return html! {};
    };
    let files = files_of_result(render).into_iter().map(|it| it.0);
    let pictures = files.filter(|it| matches!(FileKind::of(it), FileKind::Picture(_)));
    let id = render.name.trim_start_matches("jobs/");
    html! {
        h2 { a href=(page_of(&render.name)) { "Newest render" } }
        div .pictures {
            @for file in pictures.take(PICTURES) {
                a href=(file_path(id, &file)) {
                    img loading="lazy" src=(file_path(id, &file)) alt={ "Picture " (told(&file)) };
                }
            }
        }
    }
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
