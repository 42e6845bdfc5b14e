//! The audit log: entries are added and read, and never changed, but for the names of what was erased. Old ones are removed from its
//! beginning.

use crate::audit_chain::{Head, hash};
use crate::db::{Lock, Row, Tx, integer, sql};
use crate::{AuditEntry, NewAuditEntry, StoreError, Tenant};
use yoto_proto::sha256_hex;

/// What stands as the call of the entry about removed ones.
const CUT: &str = "old entries were removed";

/// Adds entries in their order, and returns their numbers.
pub(crate) async fn append(tx: &mut Tx, entries: &[NewAuditEntry]) -> Result<Vec<u64>, StoreError> {
    tx.lock(Lock::Audit).await?;
    let mut head = head(tx).await?;
    let mut numbers = Vec::with_capacity(entries.len());
    for new in entries {
        let forgotten = match new.began {
            Some(number) => is_forgotten(tx, number).await?,
            None => false,
        };
        let mut entry = AuditEntry {
            number: head.number + 1,
            time: tx.now(),
            tenant: new.tenant.clone(),
            key: new.key.clone(),
            call: new.call.clone(),
            names: if forgotten {
                String::new()
            } else {
                new.names.clone()
            },
            names_sha256: sha256_hex(new.names.as_bytes()),
            began: new.began,
            outcome: new.outcome.clone(),
            hash: String::new(),
        };
        entry.hash = hash(&head.hash, &entry);
        insert(tx, &entry).await?;
        numbers.push(entry.number);
        head = Head {
            number: entry.number,
            hash: entry.hash,
        };
    }
    Ok(numbers)
}

/// Whether an erasure has taken the names out of this entry: the end of its call must not bring them back.
async fn is_forgotten(tx: &mut Tx, number: u64) -> Result<bool, StoreError> {
    let row = sql("SELECT names, names_sha256 FROM audit WHERE number = $1")
        .bind(integer("began", number)?)
        .row(tx, "reading the audit log")
        .await?;
    let Some(row) = row else { return Ok(false) };
    Ok(row.text("names")?.is_empty() && row.text("names_sha256")? != sha256_hex(b""))
}

async fn insert(tx: &mut Tx, entry: &AuditEntry) -> Result<(), StoreError> {
    sql(
        "INSERT INTO audit (number, time, tenant, key, call, names, names_sha256, began, outcome, hash)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10)",
    )
    .bind(integer("number", entry.number)?)
    .bind(entry.time)
    .bind(&entry.tenant)
    .bind(&entry.key)
    .bind(&entry.call)
    .bind(&entry.names)
    .bind(&entry.names_sha256)
    .bind(entry.began.map(|it| integer("began", it)).transpose()?)
    .bind(&entry.outcome)
    .bind(&entry.hash)
    .execute(tx, "writing the audit log")
    .await?;
    Ok(())
}

async fn head(tx: &mut Tx) -> Result<Head, StoreError> {
    let row = sql("SELECT number, hash FROM audit ORDER BY number DESC LIMIT 1")
        .row(tx, "reading the end of the audit log")
        .await?;
    match row {
        Some(row) => Ok(Head {
            number: row.number("number")?,
            hash: row.text("hash")?,
        }),
        None => cut(tx).await,
    }
}

/// The last entry that was removed from the beginning: the chain begins after it.
pub(crate) async fn cut(tx: &mut Tx) -> Result<Head, StoreError> {
    let row = sql("SELECT number, hash FROM audit_cut")
        .row(tx, "reading the beginning of the audit log")
        .await?;
    match row {
        Some(row) => Ok(Head {
            number: row.number("number")?,
            hash: row.text("hash")?,
        }),
        None => Ok(Head::default()),
    }
}

/// Removes the entries before the time `before`, and notes the last of them. Returns their number. An entry says so: the chain tells what
/// was removed and when.
pub(crate) async fn forget_before(tx: &mut Tx, before: f64) -> Result<u64, StoreError> {
    tx.lock(Lock::Audit).await?;
    // A clock that was set back may have left older times behind newer ones: those stay with them.
    let last = sql("SELECT number, hash FROM audit
         WHERE number < (SELECT coalesce(min(number), (SELECT max(number) + 1 FROM audit)) FROM audit WHERE time >= $1)
         ORDER BY number DESC LIMIT 1")
    .bind(before)
    .row(tx, "looking for old entries of the audit log")
    .await?;
    let Some(last) = last else { return Ok(0) };
    let (number, hash) = (last.number("number")?, last.text("hash")?);
    let number: u64 = number;
    sql(
        "INSERT INTO audit_cut (one, number, hash) VALUES (1, $1, $2)
         ON CONFLICT (one) DO UPDATE SET number = excluded.number, hash = excluded.hash",
    )
    .bind(integer("number", number)?)
    .bind(hash)
    .execute(tx, "noting the beginning of the audit log")
    .await?;
    let removed = sql("DELETE FROM audit WHERE number <= $1")
        .bind(integer("number", number)?)
        .execute(tx, "removing old entries of the audit log")
        .await?;
    let cut = NewAuditEntry {
        tenant: Tenant::default().id().to_owned(),
        key: String::new(),
        call: CUT.to_owned(),
        names: String::new(),
        began: None,
        outcome: format!("REMOVED up to {number}"),
    };
    append(tx, &[cut]).await?;
    Ok(removed)
}

/// At most `most` entries after the one with this number, oldest first.
pub(crate) async fn after(
    tx: &mut Tx,
    number: u64,
    most: u32,
) -> Result<Vec<AuditEntry>, StoreError> {
    let rows = sql("SELECT * FROM audit WHERE number > $1 ORDER BY number LIMIT $2")
        .bind(integer("number", number)?)
        .bind(most)
        .rows(tx, "reading the audit log")
        .await?;
    rows.iter().map(read).collect()
}

/// The newest entries, oldest first.
pub(crate) async fn newest(tx: &mut Tx, most: u32) -> Result<Vec<AuditEntry>, StoreError> {
    let rows = sql("SELECT * FROM audit ORDER BY number DESC LIMIT $1")
        .bind(most)
        .rows(tx, "reading the audit log")
        .await?;
    rows.iter().rev().map(read).collect()
}

/// Takes the names out of all entries that have one of these ids. The chain has their SHA-256, and stays whole.
pub(crate) async fn forget(tx: &mut Tx, ids: &[String]) -> Result<u64, StoreError> {
    let mut forgotten = 0;
    for id in ids {
        forgotten += sql("UPDATE audit SET names = '' WHERE names LIKE '%' || $1 || '%'")
            .bind(id)
            .execute(tx, "taking names out of the audit log")
            .await?;
    }
    Ok(forgotten)
}

fn read(row: &Row) -> Result<AuditEntry, StoreError> {
    Ok(AuditEntry {
        number: row.number("number")?,
        time: row.real("time")?.unwrap_or_default(),
        tenant: row.text("tenant")?,
        key: row.text("key")?,
        call: row.text("call")?,
        names: row.text("names")?,
        names_sha256: row.text("names_sha256")?,
        began: row.maybe_number("began")?,
        outcome: row.text("outcome")?,
        hash: row.text("hash")?,
    })
}
