//! The jobs of the service, newest first.

use super::asker::Asker;
use super::document::{self, Page};
use super::names::{Names, about};
use super::outcome;
use super::page_error::PageError;
use super::people::more;
use super::query::Fields;
use super::words::{ago, job_state, kind, page_of, seconds};
use axum::extract::RawQuery;
use maud::{Markup, html};
use yoto_proto::progress::duration;
use yoto_proto::v1::{Job, ListJobsRequest, job};

/// Jobs per page.
const PER_PAGE: i32 = 50;

/// The choices of the list: name, title, states.
const CHOICES: [(&str, &str, &[job::State]); 4] = [
    ("", "All", &[]),
    ("open", "Open", &[job::State::Queued, job::State::Running]),
    ("failed", "Failed", &[job::State::Failed]),
    ("done", "Succeeded", &[job::State::Succeeded]),
];

/// `/jobs`
pub(crate) async fn page(asker: Asker, RawQuery(query): RawQuery) -> Result<Page, PageError> {
    let query = Fields::of_query(query);
    let chosen = query.get("show");
    let states = CHOICES.iter().find(|it| it.0 == chosen);
    let states = states.map_or(&[][..], |it| it.2);
    let request = ListJobsRequest {
        page_size: PER_PAGE,
        page_token: query.get("page").to_owned(),
        states: states.iter().map(|&it| it.into()).collect(),
        ..ListJobsRequest::default()
    };
    let list = asker.services().jobs.list_jobs(asker.request(request));
    let list = list.await?.into_inner();
    let names = Names::read(&asker, list.jobs.iter().map(about)).await?;
    let here = match chosen {
        "" => "/jobs".to_owned(),
        _ => format!(
            "/jobs?show={}",
            CHOICES
                .iter()
                .find(|it| it.0 == chosen)
                .map_or("", |it| it.0)
        ),
    };
    let body = html! {
        h1 { "Jobs" }
        nav .choices aria-label="Which jobs" {
            @for (choice, title, _) in CHOICES {
                @let path = if choice.is_empty() { "/jobs".to_owned() } else { format!("/jobs?show={choice}") };
                a href=(path) aria-current=[(choice == chosen).then_some("true")] { (title) }
            }
        }
        (table(&list.jobs, &names, asker.now()))
        (more(&here, &list.next_page_token))
    };
    Ok(document::live("Jobs", "/jobs", "", body))
}

/// Jobs, one per row.
pub(crate) fn table(jobs: &[Job], names: &Names, now: f64) -> Markup {
    html! {
        @if jobs.is_empty() { p .empty { "None." } }
        @else {
            div .scroll tabindex="0" role="group" aria-label="Table" { table .jobs {
                thead { tr { th { "Job" } th { "Of" } th { "State" } th { "Detail" } th { "Queued" } th { "Ran" } } }
                tbody { @for job in jobs { (row(job, names, now)) } }
            } }
        }
    }
}

fn row(job: &Job, names: &Names, now: f64) -> Markup {
    html! {
        tr {
            th scope="row" { a href=(page_of(&job.name)) { (kind(job)) } }
            td { (names.about(job)) }
            td { (job_state(job)) }
            td .text {
                @if let Some(progress) = job.progress.as_ref().filter(|_| job.state() == job::State::Running) {
                    progress max="100" value=(super::progress::percent(progress)) aria-label="progress" {}
                }
                (outcome::line(job))
            }
            td { (ago(now, job.create_time.as_ref())) }
            td { (took(job, now)) }
        }
    }
}

/// How long a job ran, or runs.
pub(crate) fn took(job: &Job, now: f64) -> String {
    match &job.start_time {
        Some(start) => {
            let end = job.end_time.as_ref().map_or(now, seconds);
            duration(end - seconds(start))
        }
        None => "–".to_owned(),
    }
}
