//! The users' side of jobs: create, read, list, cancel.

use super::{
    models, outcome, pins, requests,
    rows::{Columns, During, state},
};
use crate::store::{Entry, JobKind, Page, RequestKey, StoreError, new_id};
use prost::Message;
use sqlx::{SqliteConnection, sqlite::SqliteRow};
use yoto_proto::{
    names::Collection,
    v1::{Job, JobSpec, job, job_spec},
};

/// Selects jobs with their place in the queue.
macro_rules! select_jobs {
    ($rest:literal) => {
        concat!(
            "SELECT j.*, CASE WHEN j.state = 'QUEUED' THEN ",
            "(SELECT count(*) FROM jobs q WHERE q.state = 'QUEUED' AND q.ord < j.ord) ",
            "ELSE 0 END AS queue_position FROM jobs j ",
            $rest
        )
    };
}

fn read(row: &SqliteRow) -> Result<Job, StoreError> {
    let worker = row.maybe_text("worker")?;
    Ok(Job {
        name: Collection::Jobs.name(&row.text("id")?),
        state: state("jobs.state", &row.text("state")?, job::State::from_str_name)? as i32,
        spec: row.message("spec")?,
        progress: row.message("progress")?,
        error: row.message("error")?,
        lease: row.number("lease")?,
        lost_workers: row.number("lost_workers")?,
        cancel_requested: row.flag("cancel_requested")?,
        worker: worker
            .map(|id| Collection::Workers.name(&id))
            .unwrap_or_default(),
        sequence: row.number("sequence")?,
        create_time: row.time("create_time")?,
        start_time: row.time("start_time")?,
        end_time: row.time("end_time")?,
        queue_position: row.number("queue_position")?,
        result: row.message("result")?,
    })
}

/// Queues a job, or returns the one that `request` queued before.
pub async fn create(
    conn: &mut SqliteConnection,
    spec: JobSpec,
    request: Option<RequestKey>,
) -> Result<Job, StoreError> {
    if let Some(id) = requests::answered(conn, request.as_ref()).await? {
        return get(conn, &id).await;
    }
    let id = insert(conn, spec).await?;
    requests::remember(conn, request.as_ref(), &id).await?;
    get(conn, &id).await
}

/// Queues a job and returns its id. The names in `spec` were parsed before.
pub async fn insert(conn: &mut SqliteConnection, spec: JobSpec) -> Result<String, StoreError> {
    let unreadable = |detail: String| StoreError::Corrupt {
        what: "spec",
        detail,
    };
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
        None => return Err(unreadable("it has no kind".into())),
    };
    let target = collection
        .parse(name)
        .map_err(|error| unreadable(error.to_string()))?;
    let ingest = kind == JobKind::Ingest;
    let id = new_id();
    if !ingest {
        // It may have been deleted since the order was checked.
        models::get(conn, target).await?;
    }
    let pinned = pins::chosen(conn, &spec).await?;
    sqlx::query(
        "INSERT INTO jobs (id, kind, capture, model, spec, pinned_step)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6)",
    )
    .bind(&id)
    .bind(kind.as_str())
    .bind(ingest.then_some(target))
    .bind((!ingest).then_some(target))
    .bind(spec.encode_to_vec())
    .bind(pinned)
    .execute(conn)
    .await
    .during("queueing a job")?;
    Ok(id)
}

/// A job by id.
pub async fn get(conn: &mut SqliteConnection, id: &str) -> Result<Job, StoreError> {
    let row = sqlx::query(select_jobs!("WHERE j.id = ?1"))
        .bind(id)
        .fetch_optional(conn)
        .await
        .during("reading a job")?;
    match row {
        Some(row) => read(&row),
        None => Err(StoreError::NotFound {
            name: Collection::Jobs.name(id),
        }),
    }
}

/// Jobs in one of `states`, or all, newest first.
pub async fn list(
    conn: &mut SqliteConnection,
    page: Page,
    states: &[job::State],
) -> Result<Vec<Entry<Job>>, StoreError> {
    let names: Vec<&str> = states.iter().map(job::State::as_str_name).collect();
    let rows = sqlx::query(select_jobs!(
        "WHERE j.ord < ?1 AND (?3 = '' OR instr(?3, ' ' || j.state || ' ') > 0)
         ORDER BY j.ord DESC LIMIT ?2"
    ))
    .bind(page.after.unwrap_or(i64::MAX))
    .bind(page.limit)
    .bind(match names.is_empty() {
        true => String::new(),
        false => format!(" {} ", names.join(" ")),
    })
    .fetch_all(conn)
    .await
    .during("listing jobs")?;
    rows.iter()
        .map(|row| {
            Ok(Entry {
                position: row.number("ord")?,
                item: read(row)?,
            })
        })
        .collect()
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

/// Ends a QUEUED job at once and marks a RUNNING one.
pub async fn cancel(conn: &mut SqliteConnection, id: &str) -> Result<Job, StoreError> {
    let job = get(conn, id).await?;
    if job.state() == job::State::Queued {
        outcome::cancel_queued(conn, id).await?;
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
    get(conn, id).await
}
