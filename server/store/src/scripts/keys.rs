//! Keys of callers. What is stored of a key is its SHA-256: 244 random bits need no slow hash.

use super::page;
use crate::db::{Row, Tx, sql, timestamp};
use crate::{Entry, KeyRow, NewKey, Page, StoreError, Tenant, new_id};
use yoto_proto::names::Collection;
use yoto_proto::v1::{Key, Scope};

/// A day, seconds.
const DAY: f64 = 86_400.0;
/// Time after its end for which a session is kept, seconds: the audit log names it by its id.
const KEPT: f64 = 90.0 * DAY;
/// Most sessions of a person at the same time.
const SESSIONS: i64 = 20;

/// Adds a key. With one of a session, sessions that ended long ago are forgotten, and those of the same person beyond
/// [`SESSIONS`] end.
pub(crate) async fn create(tx: &mut Tx, tenant: &Tenant, new: &NewKey) -> Result<Key, StoreError> {
    if new.session {
        limit_sessions(tx, tenant, &new.display_name).await?;
    }
    let id = new_id();
    let names: Vec<&str> = new.scopes.iter().map(Scope::as_str_name).collect();
    let now = tx.now();
    sql(
        "INSERT INTO keys (id, tenant, display_name, sha256, scopes, create_time, expire_time, session)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8)",
    )
    .bind(&id)
    .bind(tenant.id())
    .bind(&new.display_name)
    .bind(&new.sha256)
    .bind(names.join(" "))
    .bind(now)
    .bind(new.expire_time)
    .bind(new.session)
    .execute(tx, "creating a key")
    .await?;
    Ok(Key {
        name: Collection::Keys.name(&id),
        display_name: new.display_name.clone(),
        tenant: tenant.id().to_owned(),
        scopes: new.scopes.iter().map(|it| (*it).into()).collect(),
        create_time: Some(timestamp(now)),
        expire_time: new.expire_time.map(timestamp),
        last_use_time: None,
        revoke_time: None,
    })
}

async fn limit_sessions(tx: &mut Tx, tenant: &Tenant, person: &str) -> Result<(), StoreError> {
    sql("DELETE FROM keys WHERE session = 1 AND expire_time < $1")
        .bind(tx.now() - KEPT)
        .execute(tx, "forgetting sessions")
        .await?;
    sql("UPDATE keys SET revoke_time = $3
         WHERE session = 1 AND tenant = $1 AND display_name = $2 AND revoke_time IS NULL AND id NOT IN
             (SELECT id FROM keys WHERE session = 1 AND tenant = $1 AND display_name = $2 AND revoke_time IS NULL
              ORDER BY ord DESC LIMIT $4)")
    .bind(tenant.id())
    .bind(person)
    .bind(tx.now())
    .bind(SESSIONS - 1)
    .execute(tx, "ending sessions")
    .await?;
    Ok(())
}

/// All keys, for the check of each call. Of sessions that ended a day ago, only the newest key: a service that ever had one asks for
/// one.
pub(crate) async fn all(tx: &mut Tx) -> Result<Vec<KeyRow>, StoreError> {
    let rows = sql(
        "SELECT k.id, k.tenant, k.sha256, k.scopes, k.expire_time, k.used_time, k.revoke_time, k.session,
             q.calls_per_second
         FROM keys k LEFT JOIN quotas q ON q.tenant = k.tenant
         WHERE k.session = 0 OR k.ord = (SELECT max(ord) FROM keys)
             OR (k.expire_time > $1 AND (k.revoke_time IS NULL OR k.revoke_time > $1))",
    )
    .bind(tx.now() - DAY)
    .rows(tx, "reading the keys")
    .await?;
    rows.iter()
        .map(|row| {
            Ok(KeyRow {
                id: row.text("id")?,
                tenant: row.text("tenant")?,
                sha256: row.text("sha256")?,
                scopes: scopes(row)?,
                expire_time: row.real("expire_time")?,
                used_time: row.real("used_time")?,
                revoked: row.real("revoke_time")?.is_some(),
                calls_per_second: row.real("calls_per_second")?,
                session: row.flag("session")?,
            })
        })
        .collect()
}

/// The keys of a tenant, newest first.
pub(crate) async fn list(
    tx: &mut Tx,
    tenant: &Tenant,
    page: Page,
) -> Result<Vec<Entry<Key>>, StoreError> {
    let rows = sql("SELECT * FROM keys WHERE tenant = $1 AND ord < $2 ORDER BY ord DESC LIMIT $3")
        .bind(tenant.id())
        .bind(page.after.unwrap_or(i64::MAX))
        .bind(page.limit)
        .rows(tx, "listing keys")
        .await?;
    page::entries(&rows, read)
}

/// Revokes a key of the tenant, or of any tenant. A second revocation keeps the time of the first.
pub(crate) async fn revoke(
    tx: &mut Tx,
    tenant: Option<&Tenant>,
    id: &str,
) -> Result<Key, StoreError> {
    sql("UPDATE keys SET revoke_time = coalesce(revoke_time, $3)
         WHERE id = $1 AND ($2 IS NULL OR tenant = $2)")
    .bind(id)
    .bind(tenant.map(Tenant::id).map(str::to_owned))
    .bind(tx.now())
    .execute(tx, "revoking a key")
    .await?;
    get(tx, tenant, id).await
}

/// A key of the tenant, or of any tenant.
pub(crate) async fn get(tx: &mut Tx, tenant: Option<&Tenant>, id: &str) -> Result<Key, StoreError> {
    let row = sql("SELECT * FROM keys WHERE id = $1 AND ($2 IS NULL OR tenant = $2)")
        .bind(id)
        .bind(tenant.map(Tenant::id).map(str::to_owned))
        .row(tx, "reading a key")
        .await?;
    match row {
        Some(row) => read(&row),
        None => Err(StoreError::NotFound {
            name: Collection::Keys.name(id),
        }),
    }
}

/// Notes that the key was used now.
pub(crate) async fn note_use(tx: &mut Tx, id: &str) -> Result<(), StoreError> {
    sql("UPDATE keys SET used_time = $2 WHERE id = $1")
        .bind(id)
        .bind(tx.now())
        .execute(tx, "noting the use of a key")
        .await?;
    Ok(())
}

fn scopes(row: &Row) -> Result<Vec<Scope>, StoreError> {
    let names = row.text("scopes")?;
    names
        .split(' ')
        .map(|name| {
            Scope::from_str_name(name).ok_or_else(|| StoreError::Corrupt {
                what: "scopes",
                detail: name.to_owned(),
            })
        })
        .collect()
}

fn read(row: &Row) -> Result<Key, StoreError> {
    let id = row.text("id")?;
    Ok(Key {
        name: Collection::Keys.name(&id),
        display_name: row.text("display_name")?,
        tenant: row.text("tenant")?,
        scopes: scopes(row)?.into_iter().map(i32::from).collect(),
        create_time: row.time("create_time")?,
        expire_time: row.time("expire_time")?,
        last_use_time: row.time("used_time")?,
        revoke_time: row.time("revoke_time")?,
    })
}
