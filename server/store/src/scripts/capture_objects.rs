//! What an ingest job makes of a capture: its frames for trainings, and the check's report and a thumbnail for people.

use crate::StoreError;
use crate::db::{Tx, integer, sql};
use yoto_proto::keys::{CHECK, FRAMES, THUMBNAIL};
use yoto_proto::v1::{IngestResult, RenderedFile};

/// Records the files of a capture that became READY, in place of earlier ones.
pub async fn record(
    tx: &mut Tx,
    capture_id: &str,
    result: &IngestResult,
) -> Result<(), StoreError> {
    for (file, object) in [(CHECK, &result.check), (THUMBNAIL, &result.thumbnail)] {
        let Some(object) = object else { continue };
        sql(
            "INSERT INTO capture_objects (capture, file, key, bytes, sha256)
             VALUES ($1, $2, $3, $4, $5)
             ON CONFLICT (capture, file) DO UPDATE SET key = excluded.key, bytes = excluded.bytes,
                 sha256 = excluded.sha256",
        )
        .bind(capture_id)
        .bind(file)
        .bind(&object.key)
        .bind(integer("result.ingest.bytes", object.bytes)?)
        .bind(&object.sha256)
        .execute(tx, "recording the files of a capture")
        .await?;
    }
    Ok(())
}

/// The files of a capture, by name.
pub async fn list(tx: &mut Tx, capture_id: &str) -> Result<Vec<RenderedFile>, StoreError> {
    let rows = sql(
        "SELECT file, key, bytes, sha256 FROM capture_objects WHERE capture = $1
         UNION ALL
         SELECT $2 AS file, shard_key AS key, shard_bytes AS bytes, shard_sha256 AS sha256
         FROM captures WHERE id = $1 AND shard_key IS NOT NULL
         ORDER BY file",
    )
    .bind(capture_id)
    .bind(FRAMES)
    .rows(tx, "listing the files of a capture")
    .await?;
    rows.iter()
        .map(|row| {
            Ok(RenderedFile {
                file: row.text("file")?,
                object: row.object("key", "bytes", "sha256")?,
            })
        })
        .collect()
}
