//! Records of what people have agreed to. [`super::consent_rule`] decides what follows from them.

use super::{erasures, requests, subjects};
use crate::db::{Lock, Row, Tx, integer, sql, timestamp};
use crate::rules::rights;
use crate::{Entry, NewConsent, NewEvidence, Page, RequestKey, StoreError, Tenant, new_id};
use yoto_proto::names::Collection;
use yoto_proto::sha256_hex;
use yoto_proto::v1::consent_item::State;
use yoto_proto::v1::{Consent, ConsentItem, ConsentPurpose, Evidence};

/// Records a consent, or returns the one that `request` recorded before.
pub(crate) async fn grant(
    tx: &mut Tx,
    tenant: &Tenant,
    subject_id: &str,
    new: &NewConsent,
    request: Option<RequestKey>,
) -> Result<Consent, StoreError> {
    if let Some(id) = requests::begin(tx, tenant, request.as_ref()).await? {
        return get(tx, tenant, &id).await;
    }
    tx.lock(Lock::Subject(subject_id)).await?;
    subjects::get(tx, tenant, subject_id).await?;
    erasures::refuse_if_begun(tx, subject_id).await?;
    let id = insert(tx, subject_id, new).await?;
    for purpose in &new.purposes {
        insert_purpose(tx, &id, *purpose, None).await?;
    }
    if let Some(evidence) = &new.evidence {
        sql("INSERT INTO consent_evidence (consent, file_name, bytes, sha256, content) VALUES ($1, $2, $3, $4, $5)")
            .bind(&id)
            .bind(&evidence.file_name)
            .bind(integer("evidence.bytes", evidence.content.len() as u64)?)
            .bind(sha256_hex(&evidence.content))
            .bind(evidence.content.clone())
            .execute(tx, "storing the evidence of a consent")
            .await?;
    }
    requests::remember(tx, tenant, request.as_ref(), &id).await?;
    get(tx, tenant, &id).await
}

/// Revokes every grant of these purposes. Where there was none, a refusal with this note is recorded, so that jobs are refused
/// from now on whether or not the service asks for consent.
pub(crate) async fn revoke(
    tx: &mut Tx,
    tenant: &Tenant,
    subject_id: &str,
    purposes: &[ConsentPurpose],
    note: &str,
    request: Option<RequestKey>,
) -> Result<(), StoreError> {
    if requests::begin(tx, tenant, request.as_ref())
        .await?
        .is_some()
    {
        return Ok(());
    }
    tx.lock(Lock::Subject(subject_id)).await?;
    subjects::get(tx, tenant, subject_id).await?;
    let mut refused = Vec::new();
    for purpose in purposes {
        sql(
            "UPDATE consent_purposes SET revoke_time = $3 WHERE purpose = $2 AND revoke_time IS NULL
                 AND consent IN (SELECT id FROM consents WHERE subject = $1)",
        )
        .bind(subject_id)
        .bind(purpose.as_str_name())
        .bind(tx.now())
        .execute(tx, "revoking a consent")
        .await?;
        if !is_recorded(tx, subject_id, *purpose).await? {
            refused.push(*purpose);
        }
    }
    if !refused.is_empty() {
        let refusal = NewConsent {
            note: note.to_owned(),
            ..NewConsent::default()
        };
        let id = insert(tx, subject_id, &refusal).await?;
        let now = tx.now();
        for purpose in refused {
            insert_purpose(tx, &id, purpose, Some(now)).await?;
        }
    }
    requests::remember(tx, tenant, request.as_ref(), subject_id).await
}

async fn insert(tx: &mut Tx, subject_id: &str, new: &NewConsent) -> Result<String, StoreError> {
    let id = new_id();
    sql(
        "INSERT INTO consents (id, subject, given_by, note, create_time, expire_time)
         VALUES ($1, $2, $3, $4, $5, $6)",
    )
    .bind(&id)
    .bind(subject_id)
    .bind(&new.given_by)
    .bind(&new.note)
    .bind(tx.now())
    .bind(new.expire_time)
    .execute(tx, "recording a consent")
    .await?;
    Ok(id)
}

async fn insert_purpose(
    tx: &mut Tx,
    consent_id: &str,
    purpose: ConsentPurpose,
    revoke_time: Option<f64>,
) -> Result<(), StoreError> {
    sql("INSERT INTO consent_purposes (consent, purpose, revoke_time) VALUES ($1, $2, $3)")
        .bind(consent_id)
        .bind(purpose.as_str_name())
        .bind(revoke_time)
        .execute(tx, "recording a consent")
        .await?;
    Ok(())
}

/// Whether there is any record of the purpose, be it revoked.
async fn is_recorded(
    tx: &mut Tx,
    subject_id: &str,
    purpose: ConsentPurpose,
) -> Result<bool, StoreError> {
    sql(
        "SELECT EXISTS (SELECT 1 FROM consents c JOIN consent_purposes p ON p.consent = c.id
             WHERE c.subject = $1 AND p.purpose = $2) AS found",
    )
    .bind(subject_id)
    .bind(purpose.as_str_name())
    .one(tx, "looking for a consent")
    .await?
    .flag("found")
}

/// The ids of a person's consents.
pub(crate) async fn ids(tx: &mut Tx, subject_id: &str) -> Result<Vec<String>, StoreError> {
    let rows = sql("SELECT id FROM consents WHERE subject = $1 ORDER BY ord")
        .bind(subject_id)
        .rows(tx, "listing consents")
        .await?;
    rows.iter().map(|row| row.text("id")).collect()
}

/// Selects the consents `c`, each with the file that proves it, once for each of its purposes with the state at the time `$1`.
macro_rules! select_consents {
    ($from:literal) => {
        concat!(
            "SELECT c.*, e.file_name, e.bytes, e.sha256, p.purpose, p.revoke_time,
                 CASE WHEN p.revoke_time IS NOT NULL THEN 'REVOKED' WHEN c.expire_time <= $1 THEN 'EXPIRED' ELSE 'VALID'
                 END AS state
             FROM ",
            $from,
            " LEFT JOIN consent_evidence e ON e.consent = c.id LEFT JOIN consent_purposes p ON p.consent = c.id "
        )
    };
}

async fn get(tx: &mut Tx, tenant: &Tenant, id: &str) -> Result<Consent, StoreError> {
    let rows = sql(concat!(
        select_consents!("consents c JOIN subjects s ON s.id = c.subject"),
        "WHERE c.id = $2 AND s.tenant = $3"
    ))
    .bind(tx.now())
    .bind(id)
    .bind(tenant.id())
    .rows(tx, "reading a consent")
    .await?;
    let found = records(&rows)?.into_iter().next();
    let found = found.ok_or_else(|| StoreError::NotFound {
        name: Collection::Consents.name(id),
    })?;
    Ok(found.item)
}

/// The consents of a person, newest first.
pub(crate) async fn list(
    tx: &mut Tx,
    tenant: &Tenant,
    subject_id: &str,
    page: Page,
) -> Result<Vec<Entry<Consent>>, StoreError> {
    let rows = sql(concat!(
        select_consents!(
            "(SELECT a.* FROM consents a JOIN subjects s ON s.id = a.subject
              WHERE a.subject = $2 AND s.tenant = $3 AND a.ord < $4 ORDER BY a.ord DESC LIMIT $5) AS c"
        ),
        "ORDER BY c.ord DESC"
    ))
    .bind(tx.now())
    .bind(subject_id)
    .bind(tenant.id())
    .bind(page.after.unwrap_or(i64::MAX))
    .bind(page.limit)
    .rows(tx, "listing consents")
    .await?;
    if rows.is_empty() {
        // A person who does not exist has no empty list.
        subjects::get(tx, tenant, subject_id).await?;
    }
    records(&rows)
}

/// The consents of several people of the tenant, newest first.
pub(crate) async fn of_people(
    tx: &mut Tx,
    tenant: &Tenant,
    subjects: &[&str],
) -> Result<Vec<Consent>, StoreError> {
    if subjects.is_empty() {
        return Ok(Vec::new());
    }
    let mut query = sql(concat!(
        select_consents!("consents c JOIN subjects s ON s.id = c.subject"),
        "WHERE s.tenant = $2 AND c.subject IN ("
    ))
    .bind(tx.now())
    .bind(tenant.id());
    query.push_all(subjects.iter().copied());
    query.push(") ORDER BY c.ord DESC");
    let rows = query.rows(tx, "listing the consents of people").await?;
    Ok(records(&rows)?.into_iter().map(|it| it.item).collect())
}

/// What a person agrees to now and what they refuse, in one line for files that leave the service; empty where nothing is
/// recorded.
pub(crate) async fn in_words(
    tx: &mut Tx,
    tenant: &Tenant,
    subject_id: &str,
) -> Result<String, StoreError> {
    let all = Page {
        limit: u32::MAX,
        after: None,
    };
    let records = list(tx, tenant, subject_id, all).await?;
    let now = timestamp(tx.now().floor());
    Ok(rights::line(records.iter().map(|it| &it.item), now))
}

/// The record, without its purposes.
fn read(row: &Row) -> Result<Consent, StoreError> {
    Ok(Consent {
        name: Collection::Consents.name(&row.text("id")?),
        subject: Collection::Subjects.name(&row.text("subject")?),
        items: Vec::new(),
        given_by: row.text("given_by")?,
        note: row.text("note")?,
        create_time: row.time("create_time")?,
        expire_time: row.time("expire_time")?,
        evidence: evidence(row)?,
    })
}

/// The file in a row that has one.
fn evidence(row: &Row) -> Result<Option<Evidence>, StoreError> {
    let Some(file_name) = row.maybe_text("file_name")? else {
        return Ok(None);
    };
    Ok(Some(Evidence {
        file_name,
        bytes: row.number("bytes")?,
        sha256: row.text("sha256")?,
    }))
}

/// The file that proves a consent of the tenant.
pub(crate) async fn file(
    tx: &mut Tx,
    tenant: &Tenant,
    id: &str,
) -> Result<NewEvidence, StoreError> {
    let row = sql(
        "SELECT e.file_name, e.content FROM consent_evidence e JOIN consents c ON c.id = e.consent
             JOIN subjects s ON s.id = c.subject
         WHERE c.id = $1 AND s.tenant = $2",
    )
    .bind(id)
    .bind(tenant.id())
    .row(tx, "reading the evidence of a consent")
    .await?;
    let row = row.ok_or_else(|| StoreError::NotFound {
        name: Collection::Consents.name(id),
    })?;
    Ok(NewEvidence {
        file_name: row.text("file_name")?,
        content: row.bytes("content")?,
    })
}

/// The records in rows of [`select_consents!`], of which those of one record follow each other.
fn records(rows: &[Row]) -> Result<Vec<Entry<Consent>>, StoreError> {
    let mut found: Vec<Entry<Consent>> = Vec::new();
    for row in rows {
        let position = row.number("ord")?;
        if found.last().is_none_or(|it| it.position != position) {
            let item = read(row)?;
            found.push(Entry { position, item });
        }
        if let Some(it) = found.last_mut() {
            it.item.items.extend(purpose(row)?);
        }
    }
    for it in &mut found {
        it.item.items.sort_by_key(|item| item.purpose);
    }
    Ok(found)
}

/// The purpose in a row; `None` in the row of a record without one.
fn purpose(row: &Row) -> Result<Option<ConsentItem>, StoreError> {
    let Some(name) = row.maybe_text("purpose")? else {
        return Ok(None);
    };
    let purpose = ConsentPurpose::from_str_name(&name);
    let purpose = purpose.ok_or_else(|| StoreError::Corrupt {
        what: "consent_purposes.purpose",
        detail: name,
    })?;
    Ok(Some(ConsentItem {
        purpose: purpose.into(),
        state: State::from_str_name(&row.text("state")?)
            .unwrap_or_default()
            .into(),
        revoke_time: row.time("revoke_time")?,
    }))
}
