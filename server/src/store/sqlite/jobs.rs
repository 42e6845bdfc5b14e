//! The users' side of jobs: create, read, list, cancel.

use super::rows::{Columns, During, state};
use super::{attempts, models, outcome, pins, requests};
use crate::store::{Entry, JobFilter, JobKind, NewJob, Page, RequestKey, StoreError, new_id};
use prost::Message;
use sqlx::sqlite::SqliteRow;
use sqlx::{QueryBuilder, Sqlite, SqliteConnection};
use yoto_proto::names::Collection;
use yoto_proto::orders;
use yoto_proto::v1::{Job, JobPriority, JobSpec, job, job_spec};

/// Priorities by their column.
const PRIORITIES: [JobPriority; 4] = [
    JobPriority::Low,
    JobPriority::Normal,
    JobPriority::High,
    JobPriority::Urgent,
];

/// Selects jobs with their position in the queue, and everything but their orders.
macro_rules! select_jobs {
    ($rest:literal) => {
        concat!(
            "SELECT j.ord, j.id, j.kind, j.capture, j.model, j.state, j.progress, j.result, j.error,
                 j.lost_workers, j.cancel_requested, j.worker, j.sequence, j.create_time,
                 j.start_time, j.end_time, j.priority, j.owner, j.waiting_error, j.not_before,
                 CASE WHEN j.state = 'QUEUED' THEN
                     (SELECT count(*) FROM jobs q
                      WHERE q.state = 'QUEUED' AND q.priority > j.priority)
                     + (SELECT count(*) FROM jobs q
                        WHERE q.state = 'QUEUED' AND q.priority = j.priority AND q.ord < j.ord)
                 ELSE 0 END AS queue_position,
                 CASE WHEN j.kind IN ('render', 'export') THEN
                     (SELECT count(*) FROM job_outputs o WHERE o.job = j.id)
                 ELSE 0 END AS outputs
             FROM jobs j ",
            $rest
        )
    };
}

/// A job without its order.
fn read(row: &SqliteRow) -> Result<Job, StoreError> {
    let name = |collection: Collection, id: Option<String>| {
        id.map(|id| collection.name(&id)).unwrap_or_default()
    };
    let priority: usize = row.number("priority")?;
    let priority = PRIORITIES.get(priority);
    let priority = *priority.ok_or_else(|| StoreError::Corrupt {
        what: "jobs.priority",
        detail: "it is none of the four".to_owned(),
    })?;
    let sequence = row.number("sequence")?;
    Ok(Job {
        name: Collection::Jobs.name(&row.text("id")?),
        state: state("jobs.state", &row.text("state")?, job::State::from_str_name)? as i32,
        spec: None,
        progress: row.message("progress")?,
        error: row.message("error")?,
        lost_workers: row.number("lost_workers")?,
        cancel_requested: row.flag("cancel_requested")?,
        worker: name(Collection::Workers, row.maybe_text("worker")?),
        sequence,
        create_time: row.time("create_time")?,
        start_time: row.time("start_time")?,
        end_time: row.time("end_time")?,
        queue_position: row.number("queue_position")?,
        result: row.message("result")?,
        kind: JobKind::of_column(&row.text("kind")?)?.to_proto() as i32,
        model: name(Collection::Models, row.maybe_text("model")?),
        capture: name(Collection::Captures, row.maybe_text("capture")?),
        priority: priority as i32,
        owner: row.text("owner")?,
        waiting: row.message("waiting_error")?,
        retry_time: row.time("not_before")?,
        attempts: Vec::new(),
        outputs: row.number("outputs")?,
        etag: format!("{sequence}"),
    })
}

/// Queues a job, or returns the one that `request` queued before.
pub async fn create(
    conn: &mut SqliteConnection,
    new: NewJob,
    request: Option<RequestKey>,
    now: f64,
) -> Result<Job, StoreError> {
    if let Some(id) = requests::answered(conn, request.as_ref()).await? {
        return get(conn, &id).await;
    }
    let id = insert(conn, new, now).await?;
    requests::remember(conn, request.as_ref(), &id, now).await?;
    get(conn, &id).await
}

/// Queues a job and returns its id. The names in the order were parsed before.
pub async fn insert(
    conn: &mut SqliteConnection,
    new: NewJob,
    now: f64,
) -> Result<String, StoreError> {
    let unreadable = |detail: String| StoreError::Corrupt {
        what: "spec",
        detail,
    };
    let spec = &new.spec;
    let (kind, collection, name) = match &spec.kind {
        Some(job_spec::Kind::Ingest(ingest)) => {
            (JobKind::Ingest, Collection::Captures, &ingest.capture)
        }
        Some(job_spec::Kind::Train(train)) => (JobKind::Train, Collection::Models, &train.model),
        Some(job_spec::Kind::Render(render)) => {
            (JobKind::Render, Collection::Models, &render.model)
        }
        Some(job_spec::Kind::Evaluate(evaluate)) => {
            (JobKind::Evaluate, Collection::Models, &evaluate.model)
        }
        Some(job_spec::Kind::Export(export)) => {
            (JobKind::Export, Collection::Models, &export.model)
        }
        None => return Err(unreadable("it has no kind".into())),
    };
    let target = collection
        .parse(name)
        .map_err(|error| unreadable(error.to_string()))?;
    let ingest = kind == JobKind::Ingest;
    let id = new_id();
    let mut people = Vec::new();
    if !ingest {
        // It may have been deleted since the order was checked.
        people = pins::people(spec, &models::get(conn, target).await?);
    }
    let pinned = pins::chosen(conn, spec).await?;
    sqlx::query(
        "INSERT INTO jobs
             (id, kind, capture, model, spec, pinned_step, priority, owner, create_time, order_level)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10)",
    )
    .bind(&id)
    .bind(kind.as_str())
    .bind(ingest.then_some(target))
    .bind((!ingest).then_some(target))
    .bind(spec.encode_to_vec())
    .bind(pinned)
    .bind(new.priority)
    .bind(&new.owner)
    .bind(now)
    .bind(orders::level(spec))
    .execute(&mut *conn)
    .await
    .during("queueing a job")?;
    pins::pin_others(conn, &id, spec).await?;
    for subject in people {
        let subject = Collection::Subjects.parse(&subject);
        let subject = subject.map_err(|error| unreadable(error.to_string()))?;
        pins::pin_capture(conn, &id, subject).await?;
    }
    Ok(id)
}

/// The order of a job.
pub async fn spec(conn: &mut SqliteConnection, id: &str) -> Result<JobSpec, StoreError> {
    let row = sqlx::query("SELECT spec FROM jobs WHERE id = ?1")
        .bind(id)
        .fetch_optional(conn)
        .await
        .during("reading a job's order")?;
    match row {
        Some(row) => Ok(row.message("spec")?.unwrap_or_default()),
        None => Err(not_found(id)),
    }
}

fn not_found(id: &str) -> StoreError {
    StoreError::NotFound {
        name: Collection::Jobs.name(id),
    }
}

/// A job by id, without its order.
pub async fn without_order(conn: &mut SqliteConnection, id: &str) -> Result<Job, StoreError> {
    let row = sqlx::query(select_jobs!("WHERE j.id = ?1"))
        .bind(id)
        .fetch_optional(&mut *conn)
        .await
        .during("reading a job")?;
    match row {
        Some(row) => read(&row),
        None => Err(not_found(id)),
    }
}

/// A job by id, with its order.
pub async fn get(conn: &mut SqliteConnection, id: &str) -> Result<Job, StoreError> {
    Ok(Job {
        spec: Some(spec(conn, id).await?),
        ..without_order(conn, id).await?
    })
}

/// A job by id, with its order and its attempts.
pub async fn with_attempts(conn: &mut SqliteConnection, id: &str) -> Result<Job, StoreError> {
    let job = get(conn, id).await?;
    Ok(Job {
        attempts: attempts::list(conn, id).await?,
        ..job
    })
}

/// Jobs that match the filter, newest first; with their orders if `full`.
pub async fn list(
    conn: &mut SqliteConnection,
    page: Page,
    filter: &JobFilter,
    full: bool,
) -> Result<Vec<Entry<Job>>, StoreError> {
    let mut query = QueryBuilder::<Sqlite>::new(select_jobs!("WHERE j.ord < "));
    query.push_bind(page.after.unwrap_or(i64::MAX));
    if !filter.states.is_empty() {
        query.push(" AND j.state IN (");
        let mut states = query.separated(", ");
        for state in &filter.states {
            states.push_bind(state.as_str_name());
        }
        query.push(")");
    }
    if !filter.kinds.is_empty() {
        query.push(" AND j.kind IN (");
        let mut kinds = query.separated(", ");
        for kind in &filter.kinds {
            kinds.push_bind(kind.as_str());
        }
        query.push(")");
    }
    if let Some(model) = &filter.model_id {
        query.push(" AND j.model = ").push_bind(model);
    }
    if let Some(owner) = &filter.owner {
        query.push(" AND j.owner = ").push_bind(owner);
    }
    query
        .push(" ORDER BY j.ord DESC LIMIT ")
        .push_bind(page.limit);
    let rows = query
        .build()
        .fetch_all(&mut *conn)
        .await
        .during("listing jobs")?;
    let mut entries = Vec::with_capacity(rows.len());
    for row in &rows {
        let mut item = read(row)?;
        if full {
            item.spec = Some(spec(conn, &row.text("id")?).await?);
        }
        entries.push(Entry {
            position: row.number("ord")?,
            item,
        });
    }
    Ok(entries)
}

/// Numbers of QUEUED and RUNNING jobs.
pub async fn open(conn: &mut SqliteConnection) -> Result<(u64, u64), StoreError> {
    let row = sqlx::query(
        "SELECT count(*) FILTER (WHERE state = 'QUEUED') AS queued,
             count(*) FILTER (WHERE state = 'RUNNING') AS running
         FROM jobs WHERE state IN ('QUEUED', 'RUNNING')",
    )
    .fetch_one(conn)
    .await
    .during("counting jobs")?;
    Ok((row.number("queued")?, row.number("running")?))
}

/// Ends a QUEUED job at once and marks a RUNNING one; a repeated `request` changes nothing.
pub async fn cancel(
    conn: &mut SqliteConnection,
    id: &str,
    request: Option<RequestKey>,
    now: f64,
) -> Result<Job, StoreError> {
    if let Some(id) = requests::answered(conn, request.as_ref()).await? {
        return get(conn, &id).await;
    }
    let job = get(conn, id).await?;
    if job.state() == job::State::Queued {
        outcome::cancel_queued(conn, id, now).await?;
    } else {
        sqlx::query(
            "UPDATE jobs SET cancel_requested = 1, sequence = sequence + 1
             WHERE id = ?1 AND state = 'RUNNING' AND cancel_requested = 0",
        )
        .bind(id)
        .execute(&mut *conn)
        .await
        .during("asking for a job to be cancelled")?;
    }
    requests::remember(conn, request.as_ref(), id, now).await?;
    get(conn, id).await
}
