//! Request ids: a repeated call gets the answer of the first.

use super::rows::{Columns, During};
use super::steps::age;
use crate::store::{RequestKey, StoreError};
use crate::tenant::Tenant;
use sqlx::SqliteConnection;

/// The id in the earlier answer to the same request, if there was one.
pub async fn answered(
    conn: &mut SqliteConnection,
    tenant: &Tenant,
    request: Option<&RequestKey>,
) -> Result<Option<String>, StoreError> {
    let Some(request) = request else {
        return Ok(None);
    };
    let row = sqlx::query(
        "SELECT body_sha256, answer FROM request_ids WHERE tenant = ?1 AND method = ?2 AND request_id = ?3",
    )
    .bind(tenant.id())
    .bind(request.method)
    .bind(&request.request_id)
    .fetch_optional(conn)
    .await
    .during("looking up a request id")?;
    let Some(row) = row else {
        return Ok(None);
    };
    if row.text("body_sha256")? != request.body_sha256 {
        return Err(StoreError::RequestIdReused {
            request_id: request.request_id.clone(),
        });
    }
    row.text("answer").map(Some)
}

/// Stores the answer to a request.
pub async fn remember(
    conn: &mut SqliteConnection,
    tenant: &Tenant,
    request: Option<&RequestKey>,
    answer: &str,
    now: f64,
) -> Result<(), StoreError> {
    let Some(request) = request else {
        return Ok(());
    };
    sqlx::query(
        "INSERT INTO request_ids (tenant, method, request_id, body_sha256, answer, create_time)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6)",
    )
    .bind(tenant.id())
    .bind(request.method)
    .bind(&request.request_id)
    .bind(&request.body_sha256)
    .bind(answer)
    .bind(now)
    .execute(conn)
    .await
    .during("storing a request id")?;
    Ok(())
}

/// Forgets answers that are older than `keep` seconds.
pub async fn forget(conn: &mut SqliteConnection, keep: f64, now: f64) -> Result<u64, StoreError> {
    let done = sqlx::query(concat!(
        "DELETE FROM request_ids WHERE ",
        age!("create_time"),
        " > ?2"
    ))
    .bind(now)
    .bind(keep)
    .execute(conn)
    .await
    .during("forgetting old request ids")?;
    Ok(done.rows_affected())
}
