//! Records of removals of people, and what a person who is being removed can't get any more.

use super::{consents, page, subjects};
use crate::db::{Lock, Row, Tx, sql, state};
use crate::{Entry, OpenErasure, Page, SignedReport, StoreError, Tenant, new_id};
use yoto_proto::names::Collection;
use yoto_proto::sha256_hex;
use yoto_proto::v1::{ConsentPurpose, Erasure, ErrorReason, erasure};

/// The erasure of a person, if it was ever begun.
pub(crate) async fn of_subject(
    tx: &mut Tx,
    tenant: &Tenant,
    subject_id: &str,
) -> Result<Option<Erasure>, StoreError> {
    let row = sql("SELECT * FROM erasures WHERE subject = $1 AND tenant = $2")
        .bind(subject_id)
        .bind(tenant.id())
        .row(tx, "looking for an erasure")
        .await?;
    row.as_ref().map(read).transpose()
}

/// Begins to remove a person, or tries again after a failure. From now on, no job needs the person.
/// `retrain` also trains the others of models whose shared parameters have seen the person anew.
pub(crate) async fn begin(
    tx: &mut Tx,
    tenant: &Tenant,
    subject_id: &str,
    retrain: bool,
) -> Result<Erasure, StoreError> {
    tx.lock(Lock::Subject(subject_id)).await?;
    if let Some(earlier) = of_subject(tx, tenant, subject_id).await? {
        if earlier.state() != erasure::State::Failed {
            return Ok(earlier);
        }
        let id = id_of(&earlier).to_owned();
        for statement in [
            "DELETE FROM erasure_models WHERE erasure = $1",
            "UPDATE erasures SET state = 'RUNNING', message = '', end_time = NULL WHERE id = $1",
        ] {
            sql(statement)
                .bind(&id)
                .execute(tx, "trying an erasure again")
                .await?;
        }
        if retrain {
            sql("UPDATE erasures SET retrain = 1 WHERE id = $1")
                .bind(&id)
                .execute(tx, "noting a training anew")
                .await?;
        }
        return get(tx, tenant, &id).await;
    }
    let subject = subjects::get(tx, tenant, subject_id).await?;
    let all = [
        ConsentPurpose::ConsentTrain,
        ConsentPurpose::ConsentRender,
        ConsentPurpose::ConsentExport,
        ConsentPurpose::ConsentShare,
    ];
    consents::revoke(tx, tenant, subject_id, &all, "", None).await?;
    let id = new_id();
    sql("INSERT INTO erasures (id, tenant, subject, name_sha256, create_time, retrain) VALUES ($1, $2, $3, $4, $5, $6)")
        .bind(&id)
        .bind(tenant.id())
        .bind(subject_id)
        .bind(sha256_hex(subject.display_name.as_bytes()))
        .bind(tx.now())
        .bind(retrain)
        .execute(tx, "beginning an erasure")
        .await?;
    get(tx, tenant, &id).await
}

/// Refuses what would give a person something new while they are being removed.
pub(crate) async fn refuse_if_begun(tx: &mut Tx, subject_id: &str) -> Result<(), StoreError> {
    let row = sql("SELECT EXISTS (SELECT 1 FROM erasures WHERE subject = $1) AS found")
        .bind(subject_id)
        .one(tx, "looking for an erasure")
        .await?;
    match row.flag("found")? {
        false => Ok(()),
        true => Err(StoreError::Rule {
            reason: ErrorReason::SubjectBusy,
            message: format!(
                "{} is being erased: nothing else is done with them any more",
                Collection::Subjects.name(subject_id)
            ),
        }),
    }
}

/// An erasure by id.
pub(crate) async fn get(tx: &mut Tx, tenant: &Tenant, id: &str) -> Result<Erasure, StoreError> {
    let row = sql("SELECT * FROM erasures WHERE id = $1 AND tenant = $2")
        .bind(id)
        .bind(tenant.id())
        .row(tx, "reading an erasure")
        .await?;
    match row {
        Some(row) => read(&row),
        None => Err(StoreError::NotFound {
            name: Collection::Erasures.name(id),
        }),
    }
}

/// Erasures, newest first.
pub(crate) async fn list(
    tx: &mut Tx,
    tenant: &Tenant,
    page: Page,
) -> Result<Vec<Entry<Erasure>>, StoreError> {
    let rows =
        sql("SELECT * FROM erasures WHERE tenant = $1 AND ord < $2 ORDER BY ord DESC LIMIT $3")
            .bind(tenant.id())
            .bind(page.after.unwrap_or(i64::MAX))
            .bind(page.limit)
            .rows(tx, "listing erasures")
            .await?;
    page::entries(&rows, read)
}

/// All of all tenants, the oldest first.
pub(crate) async fn all(tx: &mut Tx) -> Result<Vec<Erasure>, StoreError> {
    let rows = sql("SELECT * FROM erasures ORDER BY ord")
        .rows(tx, "listing all erasures")
        .await?;
    rows.iter().map(read).collect()
}

/// Begins to remove a person of any tenant, if they are in the database.
pub(crate) async fn again(tx: &mut Tx, subject_id: &str) -> Result<bool, StoreError> {
    let row = sql("SELECT tenant FROM subjects WHERE id = $1")
        .bind(subject_id)
        .row(tx, "looking for a person")
        .await?;
    let Some(row) = row else { return Ok(false) };
    let tenant = tenant(&row)?;
    begin(tx, &tenant, subject_id, false).await?;
    Ok(true)
}

fn tenant(row: &Row) -> Result<Tenant, StoreError> {
    let tenant = row.text("tenant")?;
    Tenant::new(&tenant).ok_or(StoreError::Corrupt {
        what: "tenant",
        detail: tenant,
    })
}

/// Those that go on, of all tenants.
pub(crate) async fn open(tx: &mut Tx) -> Result<Vec<OpenErasure>, StoreError> {
    let rows =
        sql("SELECT id, tenant, subject, work, retrain FROM erasures WHERE state = 'RUNNING' ORDER BY ord")
            .rows(tx, "listing open erasures")
            .await?;
    rows.iter()
        .map(|row| {
            Ok(OpenErasure {
                id: row.text("id")?,
                tenant: tenant(row)?,
                subject_id: row.text("subject")?,
                work: row.maybe_text("work")?,
                retrain: row.flag("retrain")?,
            })
        })
        .collect()
}

/// Tells what an erasure waits for.
pub(crate) async fn wait(tx: &mut Tx, id: &str, message: &str) -> Result<(), StoreError> {
    sql("UPDATE erasures SET message = $2 WHERE id = $1 AND state = 'RUNNING' AND message <> $2")
        .bind(id)
        .bind(message)
        .execute(tx, "noting what an erasure waits for")
        .await?;
    Ok(())
}

/// Ends an erasure that can't go on.
pub(crate) async fn fail(tx: &mut Tx, id: &str, message: &str) -> Result<(), StoreError> {
    sql(
        "UPDATE erasures SET state = 'FAILED', message = $2, end_time = $3
         WHERE id = $1 AND state = 'RUNNING'",
    )
    .bind(id)
    .bind(message)
    .bind(tx.now())
    .execute(tx, "ending an erasure")
    .await?;
    Ok(())
}

/// Notes what is still to be done once the rows are gone.
pub(crate) async fn note_work(tx: &mut Tx, id: &str, work: &str) -> Result<(), StoreError> {
    sql("UPDATE erasures SET work = $2, message = '' WHERE id = $1 AND state = 'RUNNING'")
        .bind(id)
        .bind(work)
        .execute(tx, "noting the work of an erasure")
        .await?;
    Ok(())
}

/// Ends an erasure with its report. What it had noted, with the person's name, goes.
pub(crate) async fn done(tx: &mut Tx, id: &str, report: &SignedReport) -> Result<(), StoreError> {
    sql(
        "UPDATE erasures SET state = 'DONE', message = '', work = NULL, report = $2, signature = $3, public_key = $4,
             end_time = $5 WHERE id = $1 AND state = 'RUNNING'",
    )
    .bind(id)
    .bind(&report.json)
    .bind(&report.signature)
    .bind(&report.public_key)
    .bind(tx.now())
    .execute(tx, "ending an erasure")
    .await?;
    Ok(())
}

/// The id in its name.
fn id_of(erasure: &Erasure) -> &str {
    erasure.name.trim_start_matches("erasures/")
}

fn read(row: &Row) -> Result<Erasure, StoreError> {
    let text = row.text("state")?;
    Ok(Erasure {
        name: Collection::Erasures.name(&row.text("id")?),
        subject: Collection::Subjects.name(&row.text("subject")?),
        name_sha256: row.text("name_sha256")?,
        state: state("erasures.state", &text, erasure::State::from_str_name)? as i32,
        create_time: row.time("create_time")?,
        end_time: row.time("end_time")?,
        message: row.text("message")?,
        report: row.text("report")?,
        signature: row.text("signature")?,
        public_key: row.text("public_key")?,
    })
}
