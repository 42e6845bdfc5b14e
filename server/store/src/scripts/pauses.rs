//! Kinds of jobs that are not leased at present.

use super::service_state::by;
use crate::db::{Tx, sql};
use crate::{JobKind, OperatorNote, StoreError, Tenant};
use yoto_proto::v1::PausedKind;

/// Pauses a kind, or changes the reason of its pause.
pub(crate) async fn pause(
    tx: &mut Tx,
    tenant: &Tenant,
    kind: JobKind,
    note: OperatorNote<'_>,
) -> Result<(), StoreError> {
    sql(
        "INSERT INTO paused_kinds (kind, reason, since, tenant, by_key) VALUES ($1, $2, $3, $4, $5)
         ON CONFLICT (tenant, kind) DO UPDATE SET reason = $2, by_key = $5",
    )
    .bind(kind.as_str())
    .bind(note.reason)
    .bind(tx.now())
    .bind(tenant.id())
    .bind(note.key)
    .execute(tx, "pausing a kind of jobs")
    .await?;
    Ok(())
}

/// Ends the pause of a kind.
pub(crate) async fn resume(tx: &mut Tx, tenant: &Tenant, kind: JobKind) -> Result<(), StoreError> {
    sql("DELETE FROM paused_kinds WHERE kind = $1 AND tenant = $2")
        .bind(kind.as_str())
        .bind(tenant.id())
        .execute(tx, "resuming a kind of jobs")
        .await?;
    Ok(())
}

/// The paused kinds.
pub(crate) async fn list(tx: &mut Tx, tenant: &Tenant) -> Result<Vec<PausedKind>, StoreError> {
    let rows = sql("SELECT * FROM paused_kinds WHERE tenant = $1 ORDER BY kind")
        .bind(tenant.id())
        .rows(tx, "listing paused kinds of jobs")
        .await?;
    rows.iter()
        .map(|row| {
            Ok(PausedKind {
                kind: JobKind::of_column(&row.text("kind")?)?.to_proto() as i32,
                reason: row.text("reason")?,
                since: row.time("since")?,
                by: by(row)?,
            })
        })
        .collect()
}
