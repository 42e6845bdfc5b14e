//! Kinds of jobs that are not leased at present.

use super::rows::{Columns, During};
use crate::store::{JobKind, StoreError};
use sqlx::SqliteConnection;
use yoto_proto::v1::PausedKind;

/// Pauses a kind, or changes the reason of its pause.
pub async fn pause(
    conn: &mut SqliteConnection,
    kind: JobKind,
    reason: &str,
    now: f64,
) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO paused_kinds (kind, reason, since) VALUES (?1, ?2, ?3)
         ON CONFLICT (kind) DO UPDATE SET reason = ?2",
    )
    .bind(kind.as_str())
    .bind(reason)
    .bind(now)
    .execute(conn)
    .await
    .during("pausing a kind of jobs")?;
    Ok(())
}

/// Ends the pause of a kind.
pub async fn resume(conn: &mut SqliteConnection, kind: JobKind) -> Result<(), StoreError> {
    sqlx::query("DELETE FROM paused_kinds WHERE kind = ?1")
        .bind(kind.as_str())
        .execute(conn)
        .await
        .during("resuming a kind of jobs")?;
    Ok(())
}

/// The paused kinds.
pub async fn list(conn: &mut SqliteConnection) -> Result<Vec<PausedKind>, StoreError> {
    let rows = sqlx::query("SELECT * FROM paused_kinds ORDER BY kind")
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
