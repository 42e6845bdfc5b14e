//! Kinds of jobs that are not leased at present.

use super::rows::{Columns, During};
use crate::store::{JobKind, StoreError};
use crate::tenant::Tenant;
use sqlx::SqliteConnection;
use yoto_proto::v1::PausedKind;

/// Pauses a kind, or changes the reason of its pause.
pub async fn pause(
    conn: &mut SqliteConnection,
    tenant: &Tenant,
    kind: JobKind,
    reason: &str,
    now: f64,
) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO paused_kinds (kind, reason, since, tenant) VALUES (?1, ?2, ?3, ?4)
         ON CONFLICT (tenant, kind) DO UPDATE SET reason = ?2",
    )
    .bind(kind.as_str())
    .bind(reason)
    .bind(now)
    .bind(tenant.id())
    .execute(conn)
    .await
    .during("pausing a kind of jobs")?;
    Ok(())
}

/// Ends the pause of a kind.
pub async fn resume(
    conn: &mut SqliteConnection,
    tenant: &Tenant,
    kind: JobKind,
) -> Result<(), StoreError> {
    sqlx::query("DELETE FROM paused_kinds WHERE kind = ?1 AND tenant = ?2")
        .bind(kind.as_str())
        .bind(tenant.id())
        .execute(conn)
        .await
        .during("resuming a kind of jobs")?;
    Ok(())
}

/// The paused kinds.
pub async fn list(
    conn: &mut SqliteConnection,
    tenant: &Tenant,
) -> Result<Vec<PausedKind>, StoreError> {
    let rows = sqlx::query("SELECT * FROM paused_kinds WHERE tenant = ?1 ORDER BY kind")
        .bind(tenant.id())
        .fetch_all(conn)
        .await
        .during("listing paused kinds of jobs")?;
    rows.iter()
        .map(|row| {
            Ok(PausedKind {
                kind: JobKind::of_column(&row.text("kind")?)?.to_proto() as i32,
                reason: row.text("reason")?,
                since: row.time("since")?,
            })
        })
        .collect()
}
