//! What consent means for jobs: a person who has revoked their consent to a purpose, or whose consent has run out, is in no job
//! of that purpose. Where the service asks for consent, nor is a person who never gave it.
//!
//! The rule is checked when a job is queued and when it is leased, in those transactions, and open jobs are looked for after
//! each revocation and as often as leases are checked. The people of a job are those whose captures are pinned to it.

use super::{models, outcome, pins};
use crate::db::{Lock, Row, Tx, sql};
use crate::{JobKind, LeaseKey, StoreError, Tenant};
use yoto_proto::names::{Collection, NameError};
use yoto_proto::v1::{ConsentPurpose, ErrorReason, JobError, JobSpec, job_spec};

/// Code of a job that has ended because of a consent.
pub(crate) const CODE: &str = "CONSENT";

/// Whether the subject `s` has a record of a purpose, be it revoked or run out.
macro_rules! recorded {
    ($purpose:literal) => {
        concat!(
            "EXISTS (SELECT 1 FROM consents c JOIN consent_purposes p ON p.consent = c.id
                 WHERE c.subject = s.id AND p.purpose = ",
            $purpose,
            ")"
        )
    };
}

/// Whether the subject `s` lacks a consent to the purpose `$2` at the time `$3`. Where `$4` is 0, only one that was recorded
/// can be lacking.
macro_rules! lacks {
    () => {
        concat!(
            "NOT EXISTS (SELECT 1 FROM consents c JOIN consent_purposes p ON p.consent = c.id
                 WHERE c.subject = s.id AND p.purpose = $2 AND p.revoke_time IS NULL
                     AND (c.expire_time IS NULL OR c.expire_time > $3))
             AND ($4 = 1 OR ",
            recorded!("$2"),
            ")"
        )
    };
}
pub(super) use {lacks, recorded};

/// The purpose of jobs of this kind. The files of a capture may be read and checked without consent: that is how its person is
/// recorded at all.
fn purpose(kind: JobKind) -> Option<ConsentPurpose> {
    match kind {
        JobKind::Ingest => None,
        JobKind::Train | JobKind::Evaluate => Some(ConsentPurpose::ConsentTrain),
        JobKind::Render => Some(ConsentPurpose::ConsentRender),
        JobKind::Export => Some(ConsentPurpose::ConsentExport),
    }
}

/// Refuses the order of a job, whose names were checked, if a person in it lacks consent.
pub(crate) async fn check(
    tx: &mut Tx,
    tenant: &Tenant,
    spec: &JobSpec,
    required: bool,
) -> Result<(), StoreError> {
    let Some(purpose) = JobKind::of(spec).and_then(purpose) else {
        return Ok(());
    };
    let unreadable = |error: NameError| StoreError::Corrupt {
        what: "spec",
        detail: error.to_string(),
    };
    let model = match &spec.kind {
        Some(job_spec::Kind::Train(it)) => &it.model,
        Some(job_spec::Kind::Render(it)) => &it.model,
        Some(job_spec::Kind::Evaluate(it)) => &it.model,
        Some(job_spec::Kind::Export(it)) => &it.model,
        Some(job_spec::Kind::Ingest(_)) | None => return Ok(()),
    };
    let model = Collection::Models.parse(model).map_err(unreadable)?;
    let model = models::get(tx, tenant, model).await?;
    for subject in pins::people(spec, &model) {
        let id = Collection::Subjects.parse(&subject).map_err(unreadable)?;
        check_person(tx, id, purpose, required).await?;
    }
    Ok(())
}

/// Refuses what needs a person's consent to `purpose`, if they lack it.
pub(crate) async fn check_person(
    tx: &mut Tx,
    subject_id: &str,
    purpose: ConsentPurpose,
    required: bool,
) -> Result<(), StoreError> {
    let row = sql(concat!(
        "SELECT s.display_name, ",
        recorded!("$2"),
        " AS recorded FROM subjects s WHERE s.id = $1 AND ",
        lacks!()
    ))
    .bind(subject_id)
    .bind(purpose.as_str_name())
    .bind(tx.now())
    .bind(required)
    .row(tx, "looking for a consent")
    .await?;
    refuse(row, purpose)
}

/// The same for a job in the queue.
pub(crate) async fn check_job(tx: &mut Tx, job_id: &str, required: bool) -> Result<(), StoreError> {
    let job = sql("SELECT kind FROM jobs WHERE id = $1")
        .bind(job_id)
        .one(tx, "reading a job's kind")
        .await?;
    let Some(purpose) = purpose(JobKind::of_column(&job.text("kind")?)?) else {
        return Ok(());
    };
    let row = sql(concat!(
        "SELECT s.display_name, ",
        recorded!("$2"),
        " AS recorded FROM job_captures j JOIN subjects s ON s.id = j.subject WHERE j.job = $1 AND ",
        lacks!(),
        " ORDER BY s.ord LIMIT 1"
    ))
    .bind(job_id)
    .bind(purpose.as_str_name())
    .bind(tx.now())
    .bind(required)
    .row(tx, "looking for the consents of a job")
    .await?;
    refuse(row, purpose)
}

/// Refuses what needs the consent of the person in the `row` that was found lacking, if there is one.
fn refuse(row: Option<Row>, purpose: ConsentPurpose) -> Result<(), StoreError> {
    match row {
        Some(row) => Err(refusal(
            &row.text("display_name")?,
            purpose,
            row.flag("recorded")?,
        )),
        None => Ok(()),
    }
}

/// The refusal that names the person and the purpose.
fn refusal(person: &str, purpose: ConsentPurpose, recorded: bool) -> StoreError {
    let word = word(purpose);
    let message = match recorded {
        true => format!(
            "the consent of {person} to {word} was revoked or has run out: leave {person} out, or record a new consent"
        ),
        false => format!(
            "{person} has given no consent to {word}: record it with `yoto subject consent NAME --for {word}`"
        ),
    };
    StoreError::Rule {
        reason: ErrorReason::Consent,
        message,
    }
}

/// The purpose as commands spell it.
fn word(purpose: ConsentPurpose) -> String {
    let name = purpose.as_str_name().trim_start_matches("CONSENT_");
    name.to_ascii_lowercase()
}

/// The error of a job that ends for want of consent.
pub(crate) fn job_error(message: String) -> JobError {
    JobError {
        code: CODE.to_owned(),
        message,
        violations: Vec::new(),
    }
}

/// Open jobs that need this person, or anybody of all tenants, and whose consent to the job's purpose was revoked or has run out.
///
/// # Errors
/// When the database fails, or a job has an unknown kind: its purpose is unknown, too.
pub(crate) async fn to_stop(
    tx: &mut Tx,
    subject_id: Option<&str>,
) -> Result<Vec<String>, StoreError> {
    let rows = sql(
        "SELECT DISTINCT j.id, j.ord, j.kind, gone.purpose FROM (
             SELECT c.subject, p.purpose FROM consents c JOIN consent_purposes p ON p.consent = c.id
             WHERE $2 IS NULL OR c.subject = $2 GROUP BY c.subject, p.purpose
             HAVING max(CASE WHEN p.revoke_time IS NULL AND (c.expire_time IS NULL OR c.expire_time > $1)
                        THEN 1 ELSE 0 END) = 0) gone
         JOIN job_captures i ON i.subject = gone.subject JOIN jobs j ON j.id = i.job
         WHERE j.state IN ('QUEUED', 'RUNNING')
         ORDER BY j.ord",
    )
    .bind(tx.now())
    .bind(subject_id.map(str::to_owned))
    .rows(tx, "looking for jobs without consent")
    .await?;
    let mut jobs = Vec::new();
    for row in &rows {
        let needed = purpose(JobKind::of_column(&row.text("kind")?)?);
        let gone = row.text("purpose")?;
        if needed.is_some_and(|it| it.as_str_name() == gone) {
            jobs.push(row.text("id")?);
        }
    }
    Ok(jobs)
}

/// Ends an open job if the consent of a person in it was revoked or has run out: a queued one as FAILED, a running one as
/// CANCELLED, after which no write of its worker counts. Returns the reason if it has ended the job.
pub(crate) async fn stop(tx: &mut Tx, job_id: &str) -> Result<Option<String>, StoreError> {
    tx.lock(Lock::Job(job_id)).await?;
    let job = sql("SELECT state, worker, lease FROM jobs WHERE id = $1")
        .bind(job_id)
        .row(tx, "reading a job without consent")
        .await?;
    let Some(job) = job else {
        return Ok(None);
    };
    let reason = match check_job(tx, job_id, false).await {
        Err(StoreError::Rule { message, .. }) => message,
        Err(error) => return Err(error),
        Ok(()) => return Ok(None),
    };
    let error = job_error(reason.clone());
    let stopped = match &*job.text("state")? {
        "QUEUED" => outcome::fail_queued(tx, job_id, &error).await?,
        "RUNNING" => {
            let lease = LeaseKey {
                job_id: job_id.to_owned(),
                worker_id: job.maybe_text("worker")?.unwrap_or_default(),
                token: job.number("lease")?,
            };
            outcome::stop(tx, &lease, &error).await?;
            true
        }
        _ => false,
    };
    Ok(stopped.then_some(reason))
}
