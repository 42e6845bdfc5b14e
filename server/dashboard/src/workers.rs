//! The workers of the service: their devices, what they do, and which of them get no jobs.

use super::actions::form;
use super::asker::Asker;
use super::document::{self, Page};
use super::names::{Names, about};
use super::page_error::PageError;
use super::people::more;
use super::progress;
use super::query::Fields;
use super::words::{ago, badge, bytes, kind_word, name, page_of, told};
use axum::extract::RawQuery;
use maud::{Markup, html};
use std::collections::{HashMap, HashSet};
use tonic::Status;
use yoto_proto::limits::REASON_CHARACTERS;
use yoto_proto::v1::{Cordon, Job, ListWorkersRequest, ServiceStatus, WorkerStatus};
use yoto_store::JobGroup;

/// Workers per page.
const PER_PAGE: i32 = 50;

/// `/workers`
pub(crate) async fn page(asker: Asker, RawQuery(query): RawQuery) -> Result<Page, PageError> {
    let query = Fields::of_query(query);
    let status = asker.status().await?;
    let request = ListWorkersRequest {
        page_size: PER_PAGE,
        page_token: query.get("page").to_owned(),
    };
    let list = asker.services().status.list_workers(asker.request(request));
    let list = list.await?.into_inner();
    let jobs = jobs_of(&asker, &list.workers).await?;
    let names = Names::read(&asker, jobs.values().map(about)).await?;
    let mut panels = Vec::new();
    for worker in &list.workers {
        let job = current_job(worker, jobs.get(&worker.job), &names);
        panels.push(panel(&asker, &status, worker, &job)?);
    }
    // A cordon is of a name, whether or not a worker has it at present.
    let worker_names: HashSet<&str> = list.workers.iter().map(|it| &*it.display_name).collect();
    let unused_cordons: Vec<&Cordon> = (status.cordons.iter())
        .filter(|it| !worker_names.contains(&*it.display_name))
        .collect();
    let body = html! {
        h1 { "Workers" }
        @if panels.is_empty() {
            p .empty { "None: jobs wait until a worker asks for them. " code { "yoto worker --service URL" } " starts one." }
        }
        @for panel in panels { (panel) }
        @if !unused_cordons.is_empty() {
            h2 { "Cordoned names without a worker" }
            @for cordon in unused_cordons { section .panel { (cordoned(&asker, cordon)?) } }
        }
        (more("/workers", &list.next_page_token))
    };
    Ok(document::live("Workers", "/workers", "", body))
}

/// The jobs that workers have, by `jobs/{id}`.
async fn jobs_of(asker: &Asker, workers: &[WorkerStatus]) -> Result<HashMap<String, Job>, Status> {
    let names = workers.iter().map(|it| it.job.trim_start_matches("jobs/"));
    let ids: Vec<String> = names
        .filter(|it| !it.is_empty())
        .map(str::to_owned)
        .collect();
    if ids.is_empty() {
        return Ok(HashMap::new());
    }
    let group = JobGroup {
        most: u32::MAX,
        ids: Some(ids),
        ..JobGroup::default()
    };
    let found = asker.backend().jobs(&asker.tenant()?, &[group]).await?;
    let found = found.into_iter().flatten();
    Ok(found.map(|job| (job.name.clone(), job)).collect())
}

/// A worker, with its [`current_job`].
fn panel(
    asker: &Asker,
    status: &ServiceStatus,
    worker: &WorkerStatus,
    current_job: &Markup,
) -> Result<Markup, Status> {
    let device = worker.device.clone().unwrap_or_default();
    let active = status.workers.iter().any(|it| it.name == worker.name);
    let cordon = status
        .cordons
        .iter()
        .find(|it| it.display_name == worker.display_name);
    let kinds: Vec<&str> = worker.kinds().map(kind_word).collect();
    Ok(html! {
        section id={ "worker-" (super::words::short(&worker.name)) } .panel {
            h2 {
                (name(&worker.display_name)) " "
                @match (cordon, active) {
                    (Some(_), _) => (badge("warn", "cordoned")),
                    (None, true) => (badge("good", "active")),
                    (None, false) => (badge("calm", "away")),
                }
                @if worker.order_level < status.order_level { " " (badge("warn", "older version")) }
            }
            div { (current_job) }
            dl .facts {
                div { dt { "Device" } dd { (told(&device.adapter)) " (" (told(&device.backend)) ")" } }
                @if device.memory_bytes > 0 { div { dt { "Memory" } dd { (bytes(device.memory_bytes)) } } }
                div { dt { "Takes" } dd { (kinds.join(", ")) @if worker.reads_films { ", films without poses" } } }
                div { dt { "Seen" } dd { (ago(asker.now(), worker.last_seen.as_ref())) } }
                @if !worker.version.is_empty() { div { dt { "Version" } dd { (told(&worker.version)) } } }
            }
            @match cordon {
                Some(cordon) => (cordoned(asker, cordon)?),
                None => details id={ "cordon-" (super::words::short(&worker.name)) } .act {
                    summary { "Cordon…" }
                    p { "Workers of this name get no more jobs; a running one continues." }
                    (form(asker, "/workers/cordon", &[("worker", &worker.display_name)], html! {
                        label { "Reason " input name="reason" maxlength=(REASON_CHARACTERS) autocomplete="off"; }
                        button { "Cordon" }
                    })?)
                },
            }
        }
    })
}

/// The job that a worker has; nothing if it was deleted meanwhile.
fn current_job(worker: &WorkerStatus, job: Option<&Job>, names: &Names) -> Markup {
    if worker.job.is_empty() {
        return html! { p .detail { "It has no job." } };
    }
    html! {
        @if let Some(job) = job {
            p { a href=(page_of(&job.name)) { bdi { (names.title(job)) } } }
            (progress::bar(job))
        }
    }
}

/// A cordon, and the form that ends it.
fn cordoned(asker: &Asker, cordon: &Cordon) -> Result<Markup, Status> {
    Ok(html! {
        p .message {
            (name(&cordon.display_name)) " gets no jobs"
            @if !cordon.reason.is_empty() { ": " (name(&cordon.reason)) }
            ", since " (ago(asker.now(), cordon.since.as_ref()))
        }
        (form(asker, "/workers/uncordon", &[("worker", &cordon.display_name)], html! { button { "Give it jobs again" } })?)
    })
}
