//! The state of the queue: how many jobs wait and run, and what keeps workers from taking them. It is one statement, since
//! pages and clients ask for all of it.

use crate::db::{Row, Tx, sql};
use crate::{JobKind, StoreError, Tenant};
use yoto_proto::names::Collection;
use yoto_proto::v1::{Cordon, Draining, PausedKind};

/// The state of the queue of a tenant.
#[derive(Debug, Clone, Default)]
pub struct ServiceState {
    /// Number of QUEUED jobs.
    pub queued: u64,
    /// Number of RUNNING jobs.
    pub running: u64,
    /// Kinds of jobs that are not leased.
    pub paused: Vec<PausedKind>,
    /// The drain of the service, if there is one.
    pub draining: Option<Draining>,
    /// The cordons of the tenant's workers, by their names.
    pub cordons: Vec<Cordon>,
}

/// The state of the queue of a tenant.
pub(crate) async fn read(tx: &mut Tx, tenant: &Tenant) -> Result<ServiceState, StoreError> {
    let rows = sql(
        "SELECT 'open' AS what, '' AS name, '' AS reason, '' AS by_key, NULL AS since,
             count(*) FILTER (WHERE state = 'QUEUED') AS queued,
             count(*) FILTER (WHERE state = 'RUNNING') AS running
         FROM jobs WHERE state IN ('QUEUED', 'RUNNING') AND tenant = $1
         UNION ALL SELECT 'paused', kind, reason, by_key, since, 0, 0 FROM paused_kinds WHERE tenant = $1
         UNION ALL SELECT 'drained', '', reason, by_key, since, 0, 0 FROM drains
         UNION ALL SELECT 'cordoned', worker, reason, by_key, since, 0, 0 FROM cordons WHERE tenant = $1
         ORDER BY name",
    )
    .bind(tenant.id())
    .rows(tx, "reading what keeps jobs from being taken")
    .await?;
    let mut state = ServiceState::default();
    for row in &rows {
        add(&mut state, row)?;
    }
    Ok(state)
}

/// The name of the key by which something was said.
pub(super) fn by(row: &Row) -> Result<String, StoreError> {
    Ok(match row.text("by_key")?.as_str() {
        "" => String::new(),
        id => Collection::Keys.name(id),
    })
}

fn add(state: &mut ServiceState, row: &Row) -> Result<(), StoreError> {
    let (reason, since, by) = (row.text("reason")?, row.time("since")?, by(row)?);
    match row.text("what")?.as_str() {
        "paused" => state.paused.push(PausedKind {
            kind: JobKind::of_column(&row.text("name")?)?.to_proto() as i32,
            reason,
            since,
            by,
        }),
        "drained" => state.draining = Some(Draining { reason, since, by }),
        "cordoned" => state.cordons.push(Cordon {
            display_name: row.text("name")?,
            reason,
            since,
            by,
        }),
        _ => {
            state.queued = row.number("queued")?;
            state.running = row.number("running")?;
        }
    }
    Ok(())
}
