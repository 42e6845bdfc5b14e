//! Request ids: a repeated call gets the answer of the first.

use super::steps::age;
use crate::db::{Tx, sql};
use crate::{RequestKey, StoreError, Tenant};

/// The id in the earlier answer to the same request, if there was one. A request that is being answered now has none.
pub(crate) async fn answered(
    tx: &mut Tx,
    tenant: &Tenant,
    request: Option<&RequestKey>,
) -> Result<Option<String>, StoreError> {
    let Some(request) = request else {
        return Ok(None);
    };
    let row = sql("SELECT body_sha256, answer FROM request_ids
         WHERE tenant = $1 AND method = $2 AND request_id = $3")
    .bind(tenant.id())
    .bind(request.method)
    .bind(&request.request_id)
    .row(tx, "looking up a request id")
    .await?;
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

/// Takes the id of a request, or returns the earlier answer to it. This is the first write of a transaction: a copy of the
/// same call waits here until the first one has its answer. The caller stores the answer with [`remember`].
pub(crate) async fn begin(
    tx: &mut Tx,
    tenant: &Tenant,
    request: Option<&RequestKey>,
) -> Result<Option<String>, StoreError> {
    let Some(request) = request else {
        return Ok(None);
    };
    let taken = sql(
        "INSERT INTO request_ids (tenant, method, request_id, body_sha256, answer, kept_since)
         VALUES ($1, $2, $3, $4, '', $5)
         ON CONFLICT (tenant, method, request_id) DO NOTHING",
    )
    .bind(tenant.id())
    .bind(request.method)
    .bind(&request.request_id)
    .bind(&request.body_sha256)
    .bind(tx.now())
    .execute(tx, "taking a request id")
    .await?;
    match taken {
        0 => answered(tx, tenant, Some(request)).await,
        _ => Ok(None),
    }
}

/// Stores the answer to a request that this transaction has begun.
pub(crate) async fn remember(
    tx: &mut Tx,
    tenant: &Tenant,
    request: Option<&RequestKey>,
    answer: &str,
) -> Result<(), StoreError> {
    let Some(request) = request else {
        return Ok(());
    };
    sql("UPDATE request_ids SET answer = $4
         WHERE tenant = $1 AND method = $2 AND request_id = $3")
    .bind(tenant.id())
    .bind(request.method)
    .bind(&request.request_id)
    .bind(answer)
    .execute(tx, "storing the answer to a request")
    .await?;
    Ok(())
}

/// Forgets answers that are older than `keep` seconds.
pub(crate) async fn forget(tx: &mut Tx, keep: f64, at: f64) -> Result<u64, StoreError> {
    let done = sql(concat!(
        "DELETE FROM request_ids WHERE ",
        age!("kept_since"),
        " > $2"
    ))
    .bind(at)
    .bind(keep)
    .execute(tx, "forgetting old request ids")
    .await?;
    Ok(done)
}
