//! The users' side of jobs: create, read, list, cancel.

use super::positions::{self, JobToPlace};
use super::{
    attempts, consent_rule, models, operators, outcome, page, pins, quotas, requests, uploads,
};
use crate::db::{Lock, Row, Statement, Tx, sql, state};
use crate::{
    Entry, JobFilter, JobKind, NewJob, OpenJobs, Page, RequestKey, StoreError, Tenant, new_id,
};
use prost::Message;
use yoto_proto::names::Collection;
use yoto_proto::orders;
use yoto_proto::v1::{Job, JobPriority, JobSpec, Progress, job, job_spec};

/// Priorities by their column.
const PRIORITIES: [JobPriority; 4] = [
    JobPriority::Low,
    JobPriority::Normal,
    JobPriority::High,
    JobPriority::Urgent,
];

/// Selects jobs with everything but their orders and their positions in the queue.
macro_rules! select_jobs {
    ($rest:literal) => {
        select_jobs!("", $rest)
    };
    // With more columns, each with a comma before it.
    ($columns:literal, $rest:literal) => {
        concat!(
            "SELECT j.ord, j.id, j.kind, j.capture, j.model, j.state, j.progress, j.result, j.error,
                 j.lost_workers, j.cancel_requested, j.worker, j.sequence, j.create_time,
                 j.start_time, j.end_time, j.priority, j.owner, j.waiting_error, j.not_before,
                 CASE WHEN j.kind IN ('render', 'export') THEN
                     (SELECT count(*) FROM job_outputs o WHERE o.job = j.id)
                 ELSE 0 END AS outputs",
            $columns,
            " FROM jobs j ",
            $rest
        )
    };
}
pub(super) use select_jobs;

/// A job without its order and its position in the queue.
pub(super) fn read(row: &Row) -> Result<Job, StoreError> {
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
        queue_position: 0,
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

/// Queues a job, or returns the one that `request` queued before. Refused if somebody in it lacks consent.
pub(crate) async fn create(
    tx: &mut Tx,
    tenant: &Tenant,
    new: NewJob,
    request: Option<RequestKey>,
    requires_consent: bool,
) -> Result<Job, StoreError> {
    if let Some(id) = requests::begin(tx, tenant, request.as_ref()).await? {
        return get(tx, tenant, &id).await;
    }
    if let Some(kind) = JobKind::of(&new.spec) {
        quotas::admit_job(tx, tenant, kind).await?;
    }
    let id = insert(tx, tenant, new).await?;
    // The people are locked: whoever revokes a consent comes before this, or finds the job.
    consent_rule::check_job(tx, &id, requires_consent).await?;
    requests::remember(tx, tenant, request.as_ref(), &id).await?;
    get(tx, tenant, &id).await
}

/// Queues a job and returns its id, unless the service is drained. The names in the order were parsed before.
pub(crate) async fn insert(
    tx: &mut Tx,
    tenant: &Tenant,
    new: NewJob,
) -> Result<String, StoreError> {
    operators::require_open(tx).await?;
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
        pins::lock_models(tx, target, spec).await?;
        // It may have been deleted since the order was checked.
        people = pins::people(spec, &models::get(tx, tenant, target).await?);
    }
    let pinned = pins::chosen(tx, tenant, spec).await?;
    let film = ingest && uploads::is_film(tx, target).await?;
    sql("INSERT INTO jobs
             (id, kind, capture, model, spec, pinned_step, priority, owner, create_time, tenant,
              order_level, trace_parent, film)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13)")
    .bind(&id)
    .bind(kind.as_str())
    .bind(ingest.then_some(target))
    .bind((!ingest).then_some(target))
    .bind(spec.encode_to_vec())
    .bind(pinned)
    .bind(new.priority)
    .bind(&new.owner)
    .bind(tx.now())
    .bind(tenant.id())
    .bind(orders::level(spec))
    .bind(new.trace_parent.map(|it| it.to_string()))
    .bind(film)
    .execute(tx, "queueing a job")
    .await?;
    pins::pin_others(tx, tenant, &id, spec).await?;
    people.sort();
    for subject in people {
        let subject = Collection::Subjects.parse(&subject);
        let subject = subject.map_err(|error| unreadable(error.to_string()))?;
        tx.lock(Lock::Subject(subject)).await?;
        pins::pin_capture(tx, tenant, &id, subject).await?;
    }
    Ok(id)
}

/// Checks that the tenant has the job.
pub(crate) async fn require(tx: &mut Tx, tenant: &Tenant, id: &str) -> Result<(), StoreError> {
    let row = sql("SELECT EXISTS (SELECT 1 FROM jobs WHERE id = $1 AND tenant = $2) AS found")
        .bind(id)
        .bind(tenant.id())
        .one(tx, "looking for a job")
        .await?;
    match row.flag("found")? {
        true => Ok(()),
        false => Err(not_found(id)),
    }
}

/// Whether a job is to be cancelled.
pub(crate) async fn cancel_requested(tx: &mut Tx, id: &str) -> Result<bool, StoreError> {
    sql("SELECT cancel_requested FROM jobs WHERE id = $1")
        .bind(id)
        .one(tx, "reading whether a job is to be cancelled")
        .await?
        .flag("cancel_requested")
}

/// The progress of a job.
pub(crate) async fn progress(tx: &mut Tx, id: &str) -> Result<Option<Progress>, StoreError> {
    let row = sql("SELECT progress FROM jobs WHERE id = $1")
        .bind(id)
        .one(tx, "reading a job's progress")
        .await?;
    row.message("progress")
}

/// The order of a job.
pub(crate) async fn spec(tx: &mut Tx, id: &str) -> Result<JobSpec, StoreError> {
    let row = sql("SELECT spec FROM jobs WHERE id = $1")
        .bind(id)
        .row(tx, "reading a job's order")
        .await?;
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
pub(crate) async fn without_order(
    tx: &mut Tx,
    tenant: &Tenant,
    id: &str,
) -> Result<Job, StoreError> {
    let query = sql(select_jobs!("WHERE j.id = $1 AND j.tenant = $2"));
    let row = query.bind(id).bind(tenant.id()).row(tx, "reading a job");
    match row.await? {
        Some(row) => with_position(tx, tenant, &row).await,
        None => Err(not_found(id)),
    }
}

/// A job by id, with its order.
pub(crate) async fn get(tx: &mut Tx, tenant: &Tenant, id: &str) -> Result<Job, StoreError> {
    let query = sql(select_jobs!(
        ", j.spec",
        "WHERE j.id = $1 AND j.tenant = $2"
    ));
    let row = query.bind(id).bind(tenant.id()).row(tx, "reading a job");
    match row.await? {
        Some(row) => Ok(Job {
            spec: Some(row.message("spec")?.unwrap_or_default()),
            ..with_position(tx, tenant, &row).await?
        }),
        None => Err(not_found(id)),
    }
}

async fn with_position(tx: &mut Tx, tenant: &Tenant, row: &Row) -> Result<Job, StoreError> {
    let mut job = read(row)?;
    place(tx, tenant, std::iter::once((row, &mut job))).await?;
    Ok(job)
}

/// A job by id, with its order and its attempts.
pub(crate) async fn with_attempts(
    tx: &mut Tx,
    tenant: &Tenant,
    id: &str,
) -> Result<Job, StoreError> {
    let job = get(tx, tenant, id).await?;
    Ok(Job {
        attempts: attempts::list(tx, id).await?,
        ..job
    })
}

/// Adds the conditions of a filter to a selection of jobs `j`.
pub(super) fn narrow(query: &mut Statement, filter: &JobFilter) {
    if !filter.states.is_empty() {
        query.push(" AND j.state IN (");
        query.push_all(filter.states.iter().map(job::State::as_str_name));
        query.push(")");
    }
    if !filter.kinds.is_empty() {
        query.push(" AND j.kind IN (");
        query.push_all(filter.kinds.iter().map(|kind| kind.as_str()));
        query.push(")");
    }
    if let Some(model) = &filter.model_id {
        query.push(" AND j.model = ");
        query.push_bind(model);
    }
    if let Some(owner) = &filter.owner {
        query.push(" AND j.owner = ");
        query.push_bind(owner);
    }
}

/// Jobs that match the filter, newest first; with their orders if `full`.
pub(crate) async fn list(
    tx: &mut Tx,
    tenant: &Tenant,
    page: Page,
    filter: &JobFilter,
    full: bool,
) -> Result<Vec<Entry<Job>>, StoreError> {
    let text = match full {
        true => select_jobs!(", j.spec", "WHERE j.tenant = $1 AND j.ord < $2"),
        false => select_jobs!("WHERE j.tenant = $1 AND j.ord < $2"),
    };
    let mut query = sql(text)
        .bind(tenant.id())
        .bind(page.after.unwrap_or(i64::MAX));
    narrow(&mut query, filter);
    query.push(" ORDER BY j.ord DESC LIMIT ");
    query.push_bind(page.limit);
    let rows = query.rows(tx, "listing jobs").await?;
    let mut entries = page::entries(&rows, read)?;
    if full {
        for (row, entry) in rows.iter().zip(&mut entries) {
            entry.item.spec = Some(row.message("spec")?.unwrap_or_default());
        }
    }
    place(
        tx,
        tenant,
        rows.iter().zip(entries.iter_mut().map(|it| &mut it.item)),
    )
    .await?;
    Ok(entries)
}

/// Sets the positions in the queue of jobs that were read from these rows.
pub(super) async fn place<'a>(
    tx: &mut Tx,
    tenant: &Tenant,
    jobs: impl Iterator<Item = (&'a Row, &'a mut Job)>,
) -> Result<(), StoreError> {
    let asked = jobs.map(|(row, job)| {
        Ok(JobToPlace {
            priority: row.number("priority")?,
            ord: row.number("ord")?,
            job,
        })
    });
    let asked = asked.collect::<Result<Vec<_>, StoreError>>()?;
    positions::fill(tx, tenant, asked).await
}

/// The open jobs of each kind, of all tenants.
pub(crate) async fn figures(tx: &mut Tx) -> Result<Vec<OpenJobs>, StoreError> {
    let rows = sql(
        "SELECT kind, count(*) FILTER (WHERE state = 'QUEUED') AS queued,
             count(*) FILTER (WHERE state = 'RUNNING') AS running,
             min(create_time) FILTER (WHERE state = 'QUEUED') AS oldest
         FROM jobs WHERE state IN ('QUEUED', 'RUNNING') GROUP BY kind",
    )
    .rows(tx, "counting jobs by kind")
    .await?;
    let now = tx.now();
    let mut open = JobKind::ALL.map(|kind| OpenJobs {
        kind,
        queued: 0,
        running: 0,
        oldest_seconds: 0.0,
    });
    for row in rows {
        let kind = JobKind::of_column(&row.text("kind")?)?;
        for it in open.iter_mut().filter(|it| it.kind == kind) {
            it.queued = row.number("queued")?;
            it.running = row.number("running")?;
            let oldest = row.real("oldest")?;
            it.oldest_seconds = oldest.map_or(0.0, |since| (now - since).max(0.0));
        }
    }
    Ok(open.to_vec())
}

/// Ends a QUEUED job at once and marks a RUNNING one; a repeated `request` changes nothing.
pub(crate) async fn cancel(
    tx: &mut Tx,
    tenant: &Tenant,
    id: &str,
    request: Option<RequestKey>,
) -> Result<Job, StoreError> {
    if let Some(id) = requests::begin(tx, tenant, request.as_ref()).await? {
        return get(tx, tenant, &id).await;
    }
    tx.lock(Lock::Job(id)).await?;
    require(tx, tenant, id).await?;
    if !outcome::cancel_queued(tx, id).await? {
        sql(
            "UPDATE jobs SET cancel_requested = 1, sequence = sequence + 1
             WHERE id = $1 AND state = 'RUNNING' AND cancel_requested = 0",
        )
        .bind(id)
        .execute(tx, "asking for a job to be cancelled")
        .await?;
    }
    requests::remember(tx, tenant, request.as_ref(), id).await?;
    get(tx, tenant, id).await
}
