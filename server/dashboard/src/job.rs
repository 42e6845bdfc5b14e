//! One job: state, place in the queue, attempts, error, progress, curves and files.

use super::actions::form;
use super::asker::Asker;
use super::document::{self, Page};
use super::jobs::took;
use super::names::{Names, about};
use super::page_error::PageError;
use super::words::{ago, badge, bytes, job_state, kind, page_of, seconds, short, told};
use super::{curves, outcome, progress, shares};
use axum::extract::Path;
use maud::{Markup, html};
use percent_encoding::{NON_ALPHANUMERIC, utf8_percent_encode};
use tonic::Status;
use yoto_http::file_kind::FileKind;
use yoto_http::job_files::files_of_result;
use yoto_proto::progress::duration;
use yoto_proto::v1::job_attempt::Outcome;
use yoto_proto::v1::{
    GetJobMetricsRequest, GetJobRequest, Job, JobAttempt, JobKind, JobPriority, ListObjectsRequest,
    MetricPoint, job,
};

/// Most files of a job that are listed, and most of its pictures that are shown.
const FILES: usize = 200;
const PICTURES: usize = 24;

/// `/jobs/{id}`
pub(crate) async fn page(asker: Asker, Path(id): Path<String>) -> Result<Page, PageError> {
    let name = format!("jobs/{id}");
    let request = GetJobRequest { name: name.clone() };
    let job = asker.services().jobs.get_job(asker.request(request));
    let job = job.await?.into_inner();
    let figures = match job.kind() {
        JobKind::Train => metrics(&asker, &name).await?,
        _ => Vec::new(),
    };
    let files = match job.kind() {
        JobKind::Render | JobKind::Evaluate | JobKind::Export => files(&asker, &job).await?,
        _ => Vec::new(),
    };
    let now = asker.now();
    let names = Names::read(&asker, [about(&job)]).await?;
    let title = names.title(&job);
    let running = job
        .progress
        .as_ref()
        .filter(|_| job.state() == job::State::Running);
    let shown = running.map_or_else(
        || title.clone(),
        |it| format!("{} % · {title}", progress::percent(it)),
    );
    let links = shares::of_job(&asker, &job).await?;
    let trainings = [figures];
    let body = html! {
        h1 { (kind(&job)) " of " (names.about(&job)) " " (job_state(&job)) }
        div #now { (progress::bar(&job)) (standing(&job, now)) }
        div #error { @if let Some(error) = &job.error { (outcome::error(error)) } }
        div #actions { (buttons(&asker, &job)?) }
        div #result { @if let Some(result) = &job.result { h2 { "Result" } (outcome::result(result)) } }
        div #curves { @if curves::any(&trainings) { h2 { "Curves" } (curves::curves(&trainings)) } }
        div #links { (links) }
        div #written { @if !files.is_empty() { h2 { "Files" } (listed(&id, &files)) } }
        h2 { "Facts" }
        (facts(&job, now))
        (attempts(&job.attempts, now))
    };
    let events = format!("job={id}");
    Ok(document::live(&shown, "/jobs", &events, body))
}

/// The figures of a training.
async fn metrics(asker: &Asker, job: &str) -> Result<Vec<MetricPoint>, Status> {
    let request = GetJobMetricsRequest {
        name: job.to_owned(),
    };
    let metrics = asker
        .services()
        .jobs
        .get_job_metrics(asker.request(request));
    Ok(metrics.await?.into_inner().points)
}

/// A file of a job: its name, and its bytes.
struct Written {
    file: String,
    bytes: u64,
}

/// The files that a job has written so far. Those of one that has succeeded are in its result.
async fn files(asker: &Asker, job: &Job) -> Result<Vec<Written>, Status> {
    let of_result = files_of_result(job).into_iter();
    if job.state() == job::State::Succeeded {
        let files = of_result.map(|(file, object)| Written {
            file,
            bytes: object.bytes,
        });
        return Ok(files.take(FILES).collect());
    }
    // An evaluation has its files once it has succeeded.
    if job.outputs == 0 {
        return Ok(Vec::new());
    }
    let request = ListObjectsRequest {
        parent: job.name.clone(),
        page_size: FILES as i32,
        ..ListObjectsRequest::default()
    };
    let list = asker
        .services()
        .objects
        .list_objects(asker.request(request));
    let objects = list.await?.into_inner().objects.into_iter();
    let files = objects.map(|it| Written {
        file: it.file,
        bytes: it.bytes,
    });
    Ok(files.collect())
}

/// Where a job stands that does not run: its place in the queue, and why it waits.
fn standing(job: &Job, now: f64) -> Markup {
    html! {
        @if job.state() == job::State::Queued {
            p .message {
                @match job.queue_position {
                    0 => "It is the next one in the queue.",
                    1 => "1 job is ahead of it.",
                    ahead => { (ahead) " jobs are ahead of it." },
                }
                @if let Some(cause) = &job.waiting { " It was put back: " (told(&cause.message)) }
                @if let Some(retry) = job.retry_time.as_ref().filter(|it| seconds(it) > now) {
                    " The next attempt is in " (duration(seconds(retry) - now)) "."
                }
            }
        }
        @if job.cancel_requested && job.state() == job::State::Running {
            p .message { "It is asked to stop, and ends with the next report of its worker." }
        }
    }
}

/// What can be done with a job in its state.
fn buttons(asker: &Asker, job: &Job) -> Result<Markup, Status> {
    let path = page_of(&job.name);
    Ok(match job.state() {
        job::State::Queued | job::State::Running if !job.cancel_requested => {
            let kept = match job.kind() {
                JobKind::Train => "The training stops and keeps its last checkpoint.",
                _ => "The job stops; what it has written stays.",
            };
            html! {
                details #cancel .act {
                    summary { "Cancel…" }
                    p { (kept) }
                    (form(asker, &format!("{path}/cancel"), &[], html! { button .bad { "Cancel the job" } })?)
                }
            }
        }
        job::State::Failed | job::State::Cancelled => form(
            asker,
            &format!("{path}/retry"),
            &[],
            html! { button { "Queue it again" } },
        )?,
        _ => html! {},
    })
}

fn facts(job: &Job, now: f64) -> Markup {
    let priority = match job.priority() {
        JobPriority::Unspecified | JobPriority::Normal => "normal",
        JobPriority::Low => "low",
        JobPriority::High => "high",
        JobPriority::Urgent => "urgent",
    };
    html! {
        dl .facts {
            div { dt { "Queued" } dd { (ago(now, job.create_time.as_ref())) } }
            div { dt { "Ran" } dd { (took(job, now)) } }
            div { dt { "Priority" } dd { (priority) } }
            @if !job.owner.is_empty() { div { dt { "Owner" } dd { bdi { (told(&job.owner)) } } } }
            @if job.lost_workers > 0 { div { dt { "Lost workers" } dd { (job.lost_workers) } } }
            @if let Some(progress) = &job.progress {
                @if !progress.device.is_empty() { div { dt { "Device" } dd { (told(&progress.device)) } } }
                @if !progress.objective.is_empty() { div { dt { "Objective" } dd { (told(&progress.objective)) } } }
                @if progress.checkpoint_step > 0 { div { dt { "Newest checkpoint" } dd { "step " (super::words::whole(progress.checkpoint_step)) } } }
            }
            div { dt { "Id" } dd { code { (short(&job.name)) } } }
        }
    }
}

fn attempts(attempts: &[JobAttempt], now: f64) -> Markup {
    html! {
        @if !attempts.is_empty() {
            h2 { "Attempts" }
            div .scroll tabindex="0" role="group" aria-label="Table" { table {
                thead { tr { th { "No." } th { "Worker" } th { "Began" } th { "Took" } th { "Outcome" } } }
                tbody {
                    @for it in attempts {
                        tr {
                            td { (it.number) }
                            td { bdi { (told(&it.worker_display_name)) } }
                            td { (ago(now, it.begin_time.as_ref())) }
                            td { (attempt_took(it, now)) }
                            td .text {
                                (outcome_badge(it.outcome()))
                                @if let Some(error) = &it.error { " " (told(&error.message)) }
                            }
                        }
                    }
                }
            } }
        }
    }
}

fn attempt_took(attempt: &JobAttempt, now: f64) -> String {
    let begin = attempt.begin_time.as_ref().map(seconds);
    let end = attempt.end_time.as_ref().map_or(now, seconds);
    begin.map_or_else(|| "–".to_owned(), |begin| duration(end - begin))
}

fn outcome_badge(outcome: Outcome) -> Markup {
    match outcome {
        Outcome::Unspecified => badge("calm", "unknown"),
        Outcome::Running => badge("busy", "running"),
        Outcome::Succeeded => badge("good", "succeeded"),
        Outcome::Failed => badge("bad", "failed"),
        Outcome::Cancelled => badge("calm", "cancelled"),
        Outcome::Returned => badge("calm", "given back by its worker"),
        Outcome::Postponed => badge("warn", "put back for later"),
        Outcome::Lost => badge("bad", "its worker was lost"),
        Outcome::Helped => badge("good", "helped with pictures"),
    }
}

/// Where a file of the job with this id is.
pub(crate) fn file_path(id: &str, file: &str) -> String {
    let file = utf8_percent_encode(file, NON_ALPHANUMERIC);
    format!("/jobs/{id}/files/{file}")
}

/// The player of a file of the job with this id. Its script has an origin of its own.
pub(crate) fn frame(id: &str, file: &str) -> Markup {
    html! {
        iframe .player src=(file_path(id, file)) sandbox="allow-scripts" loading="lazy" title={ "Player of " (told(file)) } {}
    }
}

/// The files: players, then pictures, then links to all.
fn listed(id: &str, files: &[Written]) -> Markup {
    let of = |wanted: fn(FileKind) -> bool| {
        files
            .iter()
            .filter(move |it| wanted(FileKind::of(&it.file)))
    };
    let pictures = of(|it| matches!(it, FileKind::Picture(_)));
    html! {
        @for it in of(|it| it == FileKind::Player).take(1) {
            (frame(id, &it.file))
        }
        div .pictures {
            @for it in pictures.take(PICTURES) {
                a href=(file_path(id, &it.file)) {
                    img loading="lazy" src=(file_path(id, &it.file)) alt={ "Picture " (told(&it.file)) };
                }
            }
        }
        details #files {
            summary { (super::words::count(files.len() as u64, "file")) }
            ul .files {
                @for it in files {
                    li { a href=(file_path(id, &it.file)) { (told(&it.file)) } " " span .detail { (bytes(it.bytes)) } }
                }
            }
        }
    }
}
