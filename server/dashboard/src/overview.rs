//! The first page: what happens now, and what happened last.

use super::asker::Asker;
use super::document::{self, Page};
use super::fault::Fault;
use super::names::Names;
use super::service::notices;
use super::words::{count, job_state, page_of};
use super::{jobs, models, progress};
use maud::html;
use tonic::Status;
use yoto_proto::v1::{GetStatusRequest, Job, ListJobsRequest, ListModelsRequest, job};

/// Most running, queued, ended jobs and models.
const RUNNING: i32 = 12;
const QUEUED: i32 = 8;
const ENDED: i32 = 8;
const MODELS: i32 = 6;

/// `/`
pub async fn page(asker: Asker) -> Result<Page, Fault> {
    let status = asker
        .services()
        .status
        .get_status(asker.request(GetStatusRequest {}));
    let status = status.await?.into_inner();
    let faults = asker.backend().health_faults();
    let running = of_states(&asker, &[job::State::Running], RUNNING).await?;
    let queued = of_states(&asker, &[job::State::Queued], QUEUED).await?;
    let ended = [
        job::State::Succeeded,
        job::State::Failed,
        job::State::Cancelled,
    ];
    let ended = of_states(&asker, &ended, ENDED).await?;
    let request = ListModelsRequest {
        page_size: MODELS,
        ..ListModelsRequest::default()
    };
    let list = asker.services().models.list_models(asker.request(request));
    let list = list.await?.into_inner();
    let now = asker.now();
    let mut names = Names::of(&asker);
    let mut active = Vec::new();
    for job in &running {
        let title = names.title(job).await?;
        active.push(html! {
            section .panel {
                h3 { a href=(page_of(&job.name)) { bdi { (title) } } " " (job_state(job)) }
                (progress::bar(job))
            }
        });
    }
    let models = models::table(&list.models, &mut names, now).await?;
    let queued = jobs::table(&queued, &mut names, now).await?;
    let ended = jobs::table(&ended, &mut names, now).await?;
    let percent = running
        .first()
        .and_then(|it| it.progress.as_ref())
        .map(progress::percent);
    let title = percent.map_or_else(|| "Overview".to_owned(), |it| format!("{it} % · Overview"));
    let body = html! {
        h1 { "Overview" }
        div #notices {
            @for fault in &faults { p .message .bad role="alert" { (fault) } }
            (notices(&status, now))
            @if status.workers.is_empty() {
                p .message .warn { "No worker is active: jobs wait. " a href="/workers" { "Workers" } }
            }
        }
        p .lead {
            (count(status.running, "job")) " running, " (status.queued) " queued, "
            a href="/workers" { (count(status.workers.len() as u64, "active worker")) }
        }
        div #running .panels {
            @if active.is_empty() { p .empty { "Nothing runs." } }
            @for panel in active { (panel) }
        }
        div #queue { @if status.queued > 0 { h2 { a href="/jobs?show=open" { "Queue" } } (queued) } }
        h2 { a href="/models" { "Models" } }
        @if list.models.is_empty() { p .empty { "None yet." } } @else { (models) }
        h2 { a href="/jobs" { "Ended jobs" } }
        (ended)
    };
    Ok(document::live(&title, "/", "", body))
}

/// The newest jobs in these states.
async fn of_states(asker: &Asker, states: &[job::State], most: i32) -> Result<Vec<Job>, Status> {
    let request = ListJobsRequest {
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
