//! Changes as server-sent events, from the same watches as those of gRPC.
//!
//! Each event has an id, which a reader sends back as `Last-Event-ID` (or `after` in the query) when it comes again. For one
//! job that is its sequence number. For all jobs it is a digest of the open jobs and of the newest one: as long as it is still
//! right, nothing is sent again; after a gap with changes, all open jobs are.

use super::asker::Asker;
use super::assets::BUILD;
use super::page_error::PageError;
use super::query::Fields;
use axum::extract::RawQuery;
use axum::http::HeaderMap;
use axum::http::header::CACHE_CONTROL;
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures::StreamExt;
use futures::stream::{self, BoxStream};
use std::collections::BTreeMap;
use std::future::ready;
use std::time::Duration;
use tonic::Status;
use yoto_proto::sha256_hex;
use yoto_proto::v1::{Job, ListJobsRequest, WatchJobRequest, WatchJobsRequest, WatchJobsResponse};

/// Silence after which an event says only that the service is there. A reader that hears nothing for twice as long has lost
/// it; what is no job, such as a worker, is looked at again then.
const TICK: Duration = Duration::from_secs(15);
/// Most answers of a watch that become one event.
const TOGETHER: usize = 64;
/// Characters of a digest, of 4 bits each.
const DIGEST: usize = 16;

/// `/events`: with `job`, the changes of one job; with `model`, those of its jobs; else those of all.
pub(crate) async fn stream(
    asker: Asker,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
) -> Result<Response, PageError> {
    let query = Fields::of_query(query);
    let last = headers.get("last-event-id").and_then(|it| it.to_str().ok());
    let after = last.unwrap_or_else(|| query.get("after")).to_owned();
    let changes = match (query.get("job"), query.get("model")) {
        ("", model) => of_jobs(&asker, model, after).await?,
        (job, _) => of_job(&asker, job, &after).await?,
    };
    let changes = changes
        // The page of an ended job stays open.
        .chain(stream::pending())
        // After an error the reader comes again, and gets the reason.
        .take_while(|change| ready(change.is_ok()))
        .take_until(asker.drain().clone().cancelled_owned());
    let hello = event("hello", BUILD.as_str());
    let events = stream::once(ready(Ok(hello))).chain(changes);
    let tick = KeepAlive::new().interval(TICK).event(tick());
    let events = Sse::new(events).keep_alive(tick);
    Ok(([(CACHE_CONTROL, "no-store")], events).into_response())
}

type Changes = BoxStream<'static, Result<Event, Status>>;

/// The changes of one job, after the sequence number `after`.
async fn of_job(asker: &Asker, id: &str, after: &str) -> Result<Changes, Status> {
    let request = WatchJobRequest {
        name: format!("jobs/{id}"),
        after_sequence: after.parse().unwrap_or(0),
    };
    let watch = asker
        .services()
        .jobs
        .watch_job(asker.request(request))
        .await?;
    let events = watch.into_inner().map(|answer| {
        let job = answer?.job.unwrap_or_default();
        let id = job.sequence.to_string();
        Ok(change(&id, &told(&[job], &[])))
    });
    Ok(events.boxed())
}

/// The changes of all jobs of a model, or of all models without one, unless nothing has changed since the event `after`.
async fn of_jobs(asker: &Asker, model: &str, after: String) -> Result<Changes, Status> {
    let model = match model {
        "" => String::new(),
        id => format!("models/{id}"),
    };
    // Read before the watch begins: a job that comes between the two is in the watch.
    let request = ListJobsRequest {
        model: model.clone(),
        page_size: 1,
        ..ListJobsRequest::default()
    };
    let newest = asker
        .services()
        .jobs
        .list_jobs(asker.request(request))
        .await?;
    let mut known = Known::default();
    for job in newest.into_inner().jobs {
        known.came(&job);
    }
    let request = WatchJobsRequest {
        model,
        ..WatchJobsRequest::default()
    };
    let watch = asker
        .services()
        .jobs
        .watch_jobs(asker.request(request))
        .await?;
    let mut answers = watch.into_inner().ready_chunks(TOGETHER);
    // The jobs are read before the reader is greeted: what comes after the greeting has changed since.
    let open = answers.next().await;
    let answers = stream::iter(open).chain(answers);
    let mut after = Some(after);
    let events = answers.filter_map(move |answers| {
        let event = known.event(answers);
        // Only the first one can be known: it has what is open.
        let first = after.take();
        let event = match event {
            Ok((id, _)) if first.as_deref() == Some(id.as_str()) => None,
            Ok((id, data)) => Some(Ok(change(&id, &data))),
            Err(error) => Some(Err(error)),
        };
        ready(event)
    });
    Ok(events.boxed())
}

/// What a reader of all jobs knows.
#[derive(Debug, Default)]
struct Known {
    /// Time and name of the newest job, whatever its state.
    newest: Option<(i64, i32, String)>,
    /// Sequence numbers of open jobs.
    open: BTreeMap<String, u64>,
}

impl Known {
    /// Notes a job that may be the newest.
    fn came(&mut self, job: &Job) {
        let time = job.create_time.unwrap_or_default();
        let place = (time.seconds, time.nanos, job.name.clone());
        if self.newest.as_ref() < Some(&place) {
            self.newest = Some(place);
        }
    }

    /// Id and data of the event that tells `answers`.
    fn event(
        &mut self,
        answers: Vec<Result<WatchJobsResponse, Status>>,
    ) -> Result<(String, String), Status> {
        let (mut jobs, mut deleted) = (Vec::new(), Vec::new());
        for answer in answers {
            let answer = answer?;
            jobs.extend(answer.jobs);
            deleted.extend(answer.deleted);
        }
        for job in &jobs {
            self.came(job);
            match job.state().is_terminal() {
                true => self.open.remove(&job.name),
                false => self.open.insert(job.name.clone(), job.sequence),
            };
        }
        for name in &deleted {
            self.open.remove(name);
        }
        Ok((self.digest(), told(&jobs, &deleted)))
    }

    fn digest(&self) -> String {
        let mut digest = sha256_hex(format!("{:?} {:?}", self.newest, self.open).as_bytes());
        digest.truncate(DIGEST);
        digest
    }
}

/// Changed and deleted jobs as JSON, for programs; a page only looks at itself again.
fn told(jobs: &[Job], deleted: &[String]) -> String {
    let one = |job: &Job| {
        let fraction = job.progress.as_ref().map(|it| it.fraction);
        serde_json::json!({
            "name": job.name,
            "state": job.state().as_str_name(),
            "sequence": job.sequence,
            "fraction": fraction,
        })
    };
    let jobs: Vec<_> = jobs.iter().map(one).collect();
    serde_json::json!({ "jobs": jobs, "deleted": deleted }).to_string()
}

fn change(id: &str, data: &str) -> Event {
    Event::default().event("change").id(id).data(data)
}

/// Browsers drop an event without data.
fn tick() -> Event {
    event("tick", "{}")
}

fn event(kind: &str, data: &str) -> Event {
    Event::default().event(kind).data(data)
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::body::to_bytes;
    use yoto_proto::v1::job;

    fn job(name: &str, second: i64, state: job::State, sequence: u64) -> Job {
        Job {
            name: name.into(),
            state: state.into(),
            sequence,
            create_time: Some(prost_types::Timestamp {
                seconds: second,
                nanos: 0,
            }),
            ..Job::default()
        }
    }

    fn answer(jobs: &[Job]) -> Vec<Result<WatchJobsResponse, Status>> {
        vec![Ok(WatchJobsResponse {
            jobs: jobs.to_vec(),
            deleted: Vec::new(),
        })]
    }

    #[test]
    fn the_id_of_what_is_known_tells_changes_and_does_not_depend_on_the_way() {
        let (queued, running) = (job::State::Queued, job::State::Running);
        let mut one = Known::default();
        let first = one
            .event(answer(&[job("jobs/a", 1, queued, 1)]))
            .expect("told")
            .0;
        let second = one
            .event(answer(&[job("jobs/b", 2, queued, 1)]))
            .expect("told")
            .0;
        let third = one
            .event(answer(&[job("jobs/a", 1, running, 2)]))
            .expect("told")
            .0;
        assert!(first != second && second != third);
        let mut other = Known::default();
        other.came(&job("jobs/b", 2, queued, 1));
        let open = [job("jobs/b", 2, queued, 1), job("jobs/a", 1, running, 2)];
        assert_eq!(other.event(answer(&open)).expect("told").0, third);
        // A job that came and ended in a gap.
        let mut later = Known::default();
        later.came(&job("jobs/c", 3, job::State::Failed, 4));
        assert_ne!(later.event(answer(&open)).expect("told").0, third);
    }

    #[tokio::test]
    async fn an_event_is_lines_and_an_empty_one() {
        let events = [change("7", "{}"), event("hello", "v"), tick()];
        let events = stream::iter(events.map(Ok::<_, Status>));
        let sent = to_bytes(Sse::new(events).into_response().into_body(), usize::MAX).await;
        assert_eq!(
            sent.expect("ends"),
            "event: change\nid: 7\ndata: {}\n\n\
             event: hello\ndata: v\n\n\
             event: tick\ndata: {}\n\n"
        );
        let data = told(&[job("jobs/a\nb", 1, job::State::Queued, 1)], &[]);
        assert!(!data.contains('\n'), "{data}");
    }
}
