//! Links to pages of exports. What is stored of a link's secret is its SHA-256: 244 random bits need no slow hash.

use super::consent_rule::{self, lacks, recorded};
use super::{erasures, jobs, page, subjects};
use crate::db::{Lock, Row, Tx, sql};
use crate::{Entry, NewShare, Page, ShareFilter, Shared, StoreError, Tenant, new_id};
use yoto_proto::names::Collection;
use yoto_proto::v1::share::State;
use yoto_proto::v1::{ConsentPurpose, Share};

/// What a link needs the person's consent to.
const PURPOSE: ConsentPurpose = ConsentPurpose::ConsentShare;

/// Links `h` with their states, by the purpose `$2`, the time `$3`, and `$4`: whether consent is asked for.
macro_rules! with_state {
    ($rest:literal) => {
        concat!(
            "SELECT h.*, CASE WHEN h.revoke_time IS NOT NULL THEN 'REVOKED' WHEN h.expire_time <= $3 THEN 'EXPIRED'
                 WHEN ",
            lacks!(),
            " THEN 'WITHOUT_CONSENT' ELSE 'VALID' END AS state
             FROM shares h JOIN subjects s ON s.id = h.subject ",
            $rest
        )
    };
}

/// Adds a link to an export of the tenant.
pub(crate) async fn create(
    tx: &mut Tx,
    tenant: &Tenant,
    new: &NewShare,
    required: bool,
) -> Result<Share, StoreError> {
    tx.lock(Lock::Subject(&new.subject_id)).await?;
    subjects::get(tx, tenant, &new.subject_id).await?;
    erasures::refuse_if_begun(tx, &new.subject_id).await?;
    consent_rule::check_person(tx, &new.subject_id, PURPOSE, required).await?;
    let id = new_id();
    sql(
        "INSERT INTO shares (id, tenant, job, subject, sha256, note, embed, create_time, expire_time)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9)",
    )
    .bind(&id)
    .bind(tenant.id())
    .bind(&new.job_id)
    .bind(&new.subject_id)
    .bind(&new.sha256)
    .bind(&new.note)
    .bind(new.embed)
    .bind(tx.now())
    .bind(new.expire_time)
    .execute(tx, "making a link")
    .await?;
    get(tx, tenant, &id, required).await
}

/// What the link with this SHA-256 shows; `None` if there is none, or it has ended.
pub(crate) async fn shown(
    tx: &mut Tx,
    sha256: &str,
    required: bool,
) -> Result<Option<Shared>, StoreError> {
    let row = sql(with_state!("WHERE h.sha256 = $1"))
        .bind(sha256)
        .bind(PURPOSE.as_str_name())
        .bind(tx.now())
        .bind(required)
        .row(tx, "looking for a link")
        .await?;
    let Some(row) = row else {
        return Ok(None);
    };
    let tenant = row.text("tenant")?;
    let valid = state(&row)? == State::Valid;
    let shared = || {
        Ok(Shared {
            tenant: Tenant::new(&tenant).ok_or_else(|| StoreError::Corrupt {
                what: "shares.tenant",
                detail: tenant.clone(),
            })?,
            job_id: row.text("job")?,
            embed: row.flag("embed")?,
        })
    };
    valid.then(shared).transpose()
}

/// The links of a tenant, newest first. A job or a person in the filter must be the tenant's.
pub(crate) async fn list(
    tx: &mut Tx,
    tenant: &Tenant,
    filter: &ShareFilter,
    page: Page,
    required: bool,
) -> Result<Vec<Entry<Share>>, StoreError> {
    if let Some(job) = &filter.job_id {
        jobs::require(tx, tenant, job).await?;
    }
    if let Some(subject) = &filter.subject_id {
        subjects::get(tx, tenant, subject).await?;
    }
    let rows = sql(with_state!(
        "WHERE h.tenant = $1 AND h.ord < $5 AND ($6 IS NULL OR h.job = $6) AND ($7 IS NULL OR h.subject = $7)
         ORDER BY h.ord DESC LIMIT $8"
    ))
    .bind(tenant.id())
    .bind(PURPOSE.as_str_name())
    .bind(tx.now())
    .bind(required)
    .bind(page.after.unwrap_or(i64::MAX))
    .bind(filter.job_id.clone())
    .bind(filter.subject_id.clone())
    .bind(page.limit)
    .rows(tx, "listing links")
    .await?;
    page::entries(&rows, read)
}

/// Deletes the links to pages of a person, and returns their ids.
pub(crate) async fn remove_of(tx: &mut Tx, subject_id: &str) -> Result<Vec<String>, StoreError> {
    let rows = sql("SELECT id FROM shares WHERE subject = $1 ORDER BY ord")
        .bind(subject_id)
        .rows(tx, "listing links of a person")
        .await?;
    sql("DELETE FROM shares WHERE subject = $1")
        .bind(subject_id)
        .execute(tx, "deleting links of a person")
        .await?;
    rows.iter().map(|row| row.text("id")).collect()
}

/// Revokes a link. A second revocation keeps the time of the first.
pub(crate) async fn revoke(
    tx: &mut Tx,
    tenant: &Tenant,
    id: &str,
    required: bool,
) -> Result<Share, StoreError> {
    sql("UPDATE shares SET revoke_time = coalesce(revoke_time, $3) WHERE id = $1 AND tenant = $2")
        .bind(id)
        .bind(tenant.id())
        .bind(tx.now())
        .execute(tx, "revoking a link")
        .await?;
    get(tx, tenant, id, required).await
}

async fn get(tx: &mut Tx, tenant: &Tenant, id: &str, required: bool) -> Result<Share, StoreError> {
    let row = sql(with_state!("WHERE h.id = $1 AND h.tenant = $5"))
        .bind(id)
        .bind(PURPOSE.as_str_name())
        .bind(tx.now())
        .bind(required)
        .bind(tenant.id())
        .row(tx, "reading a link")
        .await?;
    match row {
        Some(row) => read(&row),
        None => Err(StoreError::NotFound {
            name: Collection::Shares.name(id),
        }),
    }
}

fn state(row: &Row) -> Result<State, StoreError> {
    let name = row.text("state")?;
    State::from_str_name(&name).ok_or_else(|| StoreError::Corrupt {
        what: "state",
        detail: name,
    })
}

fn read(row: &Row) -> Result<Share, StoreError> {
    Ok(Share {
        name: Collection::Shares.name(&row.text("id")?),
        job: Collection::Jobs.name(&row.text("job")?),
        subject: Collection::Subjects.name(&row.text("subject")?),
        note: row.text("note")?,
        embed: row.flag("embed")?,
        state: state(row)?.into(),
        create_time: row.time("create_time")?,
        expire_time: row.time("expire_time")?,
        revoke_time: row.time("revoke_time")?,
    })
}
