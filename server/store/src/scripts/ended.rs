//! Jobs that have ended, for those who tell about them.

use super::{attempts, jobs};
use crate::db::{Tx, sql};
use crate::{EndedJob, StoreError, Tenant, TraceParent};
use std::collections::HashMap;
use yoto_proto::v1::Job;

/// Calls whose answer is a new job.
const QUEUEING: [&str; 3] = ["CreateJob", "CreateRender", "RetryJob"];

/// Those of the jobs `ids` that have ended, of all tenants, with their attempts. Jobs that were deleted are left out.
pub(crate) async fn list(tx: &mut Tx, ids: &[&str]) -> Result<Vec<EndedJob>, StoreError> {
    if ids.is_empty() {
        return Ok(Vec::new());
    }
    let mut query =
        sql("SELECT id, tenant, trace_parent FROM jobs WHERE end_time IS NOT NULL AND id IN (");
    query.push_all(ids.iter().copied());
    query.push(") ORDER BY ord");
    let rows = query.rows(tx, "looking for ended jobs").await?;
    let mut requests = requests(tx, ids).await?;
    let mut ended = Vec::with_capacity(rows.len());
    for row in rows {
        let (id, tenant) = (row.text("id")?, row.text("tenant")?);
        let parent = row.maybe_text("trace_parent")?;
        let corrupt = || StoreError::Corrupt {
            what: "jobs.tenant",
            detail: tenant.clone(),
        };
        let owner = Tenant::new(&tenant).ok_or_else(corrupt)?;
        let job = Job {
            attempts: attempts::list(tx, &id).await?,
            ..jobs::without_order(tx, &owner, &id).await?
        };
        ended.push(EndedJob {
            job,
            tenant,
            request_id: requests.remove(&id),
            trace_parent: parent.as_deref().and_then(TraceParent::parse),
        });
    }
    Ok(ended)
}

/// The request ids of the calls that queued these jobs. Answers have no index, so this reads all that are kept.
async fn requests(tx: &mut Tx, ids: &[&str]) -> Result<HashMap<String, String>, StoreError> {
    let mut query = sql("SELECT answer, request_id FROM request_ids WHERE method IN (");
    query.push_all(QUEUEING);
    query.push(") AND answer IN (");
    query.push_all(ids.iter().copied());
    query.push(")");
    let rows = query.rows(tx, "looking for the requests of jobs").await?;
    let of = rows
        .iter()
        .map(|it| Ok((it.text("answer")?, it.text("request_id")?)));
    of.collect()
}
