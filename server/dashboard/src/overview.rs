//! The first page: what happens now, and what happened last.

use super::asker::Asker;
use super::document::{self, Page};
use super::model::split;
use super::names::{Names, about};
use super::page_error::PageError;
use super::service::notices;
use super::words::{count, job_state, page_of};
use super::{jobs, models, progress};
use maud::html;
use tonic::Status;
use yoto_proto::v1::{Job, ListModelsRequest, job};
use yoto_store::{JobFilter, JobGroup};

/// Most running, queued, ended jobs and models.
const RUNNING: u32 = 12;
const QUEUED: u32 = 8;
const ENDED: u32 = 8;
const MODELS: i32 = 6;

/// `/`
pub(crate) async fn page(asker: Asker) -> Result<Page, PageError> {
    let status = asker.status().await?;
    let faults = asker.backend().health_faults();
    let [running, queued, ended] = lists(&asker).await?;
    let request = ListModelsRequest {
        page_size: MODELS,
        ..ListModelsRequest::default()
    };
    let list = asker.services().models.list_models(asker.request(request));
    let list = list.await?.into_inner();
    let now = asker.now();
    let of_jobs = running.iter().chain(&queued).chain(&ended).map(about);
    let mentioned = of_jobs.chain(models::people(&list.models));
    let names = Names::read(&asker, mentioned).await?;
    let models = models::table(&list.models, &names, now);
    let queued = jobs::table(&queued, &names, now);
    let ended = jobs::table(&ended, &names, now);
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
            @if running.is_empty() { p .empty { "Nothing runs." } }
            @for job in &running {
                section .panel {
                    h3 { a href=(page_of(&job.name)) { bdi { (names.title(job)) } } " " (job_state(job)) }
                    (progress::bar(job))
                }
            }
        }
        div #queue { @if status.queued > 0 { h2 { a href="/jobs?show=open" { "Queue" } } (queued) } }
        h2 { a href="/models" { "Models" } }
        @if list.models.is_empty() { p .empty { "None yet." } } @else { (models) }
        h2 { a href="/jobs" { "Ended jobs" } }
        (ended)
    };
    Ok(document::live(&title, "/", "", body))
}

/// The newest jobs that run, that wait, and that have ended.
async fn lists(asker: &Asker) -> Result<[Vec<Job>; 3], Status> {
    let ended = [
        job::State::Succeeded,
        job::State::Failed,
        job::State::Cancelled,
    ];
    let of_states = |states: &[job::State], most: u32, positions: bool| JobGroup {
        filter: JobFilter {
            states: states.to_vec(),
            ..JobFilter::default()
        },
        most,
        positions,
        ..JobGroup::default()
    };
    let groups = [
        of_states(&[job::State::Running], RUNNING, false),
        of_states(&[job::State::Queued], QUEUED, true),
        of_states(&ended, ENDED, false),
    ];
    let lists = asker.backend().jobs(&asker.tenant()?, &groups).await?;
    Ok(split(lists))
}
