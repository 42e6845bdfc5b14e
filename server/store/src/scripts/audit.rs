//! The audit log: entries are added and read, and never changed, but for the names of what was erased. Old ones are removed from its
//! beginning.

use crate::audit_chain::{Head, hash};
use crate::db::{Lock, Row, Tx, Value, integer, sql};
use crate::{AuditEntry, NewAuditEntry, StoreError, Tenant};
use std::collections::HashSet;
use yoto_proto::sha256_hex;

/// Most entries of one statement: each number of entries is a statement that connections keep prepared.
const AT_ONCE: usize = 16;

/// What stands as the call of the entry about removed ones.
const CUT: &str = "old entries were removed";

/// Adds entries in their order, and returns their numbers.
pub(crate) async fn append(tx: &mut Tx, entries: &[NewAuditEntry]) -> Result<Vec<u64>, StoreError> {
    tx.lock(Lock::Audit).await?;
    let mut head = head(tx).await?;
    let mut numbers = Vec::with_capacity(entries.len());
    for part in entries.chunks(AT_ONCE) {
        let chained = chained(tx, part, &mut head).await?;
        insert(tx, &chained).await?;
        numbers.extend(chained.iter().map(|it| it.number));
    }
    Ok(numbers)
}

/// The entries with their numbers and hashes, after `head`, which becomes the last of them.
async fn chained(
    tx: &mut Tx,
    new: &[NewAuditEntry],
    head: &mut Head,
) -> Result<Vec<AuditEntry>, StoreError> {
    let forgotten = forgotten(tx, new.iter().filter_map(|it| it.began)).await?;
    let mut chained = Vec::with_capacity(new.len());
    for new in new {
        let forgotten = new.began.is_some_and(|number| forgotten.contains(&number));
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
        *head = Head {
            number: entry.number,
            hash: entry.hash.clone(),
        };
        chained.push(entry);
    }
    Ok(chained)
}

/// Those of these entries whose names an erasure has taken out: the ends of their calls must not bring them back.
async fn forgotten(
    tx: &mut Tx,
    numbers: impl Iterator<Item = u64>,
) -> Result<HashSet<u64>, StoreError> {
    let numbers = numbers.map(|it| integer("began", it));
    let numbers = numbers.collect::<Result<Vec<_>, _>>()?;
    if numbers.is_empty() {
        return Ok(HashSet::new());
    }
    let mut query =
        sql("SELECT number FROM audit WHERE names = '' AND names_sha256 <> $1 AND number IN (")
            .bind(sha256_hex(b""));
    query.push_all(numbers);
    query.push(")");
    let rows = query.rows(tx, "reading the audit log").await?;
    rows.iter().map(|row| row.number("number")).collect()
}

/// Writes entries, at most [`AT_ONCE`].
async fn insert(tx: &mut Tx, entries: &[AuditEntry]) -> Result<(), StoreError> {
    let mut statement = sql(
        "INSERT INTO audit (number, time, tenant, key, call, names, names_sha256, began, outcome, hash) VALUES ",
    );
    for (i, entry) in entries.iter().enumerate() {
        let began = entry.began.map(|it| integer("began", it)).transpose()?;
        let values: [Value; 10] = [
            integer("number", entry.number)?.into(),
            entry.time.into(),
            (&entry.tenant).into(),
            (&entry.key).into(),
            (&entry.call).into(),
            (&entry.names).into(),
            (&entry.names_sha256).into(),
            began.into(),
            (&entry.outcome).into(),
            (&entry.hash).into(),
        ];
        statement.push(if i == 0 { "(" } else { ", (" });
        statement.push_all(values);
        statement.push(")");
    }
    statement.execute(tx, "writing the audit log").await?;
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
