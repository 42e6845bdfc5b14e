//! What an ingest job makes of a capture: its frames for trainings, and the check's report and a thumbnail for people.

use crate::StoreError;
use crate::db::{Tx, integer, sql};
use std::collections::HashMap;
use yoto_proto::keys::{CHECK, FRAMES, THUMBNAIL};
use yoto_proto::v1::{IngestResult, RenderedFile};

/// Records the files of a capture that became READY, in place of earlier ones.
pub(crate) async fn record(
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
pub(crate) async fn list(tx: &mut Tx, capture_id: &str) -> Result<Vec<RenderedFile>, StoreError> {
    let mut found = of_captures(tx, &[capture_id]).await?;
    Ok(found.remove(capture_id).unwrap_or_default())
}

/// The files of each of these captures by name, by the captures' ids. A capture without files is missing.
pub(crate) async fn of_captures(
    tx: &mut Tx,
    captures: &[&str],
) -> Result<HashMap<String, Vec<RenderedFile>>, StoreError> {
    let mut found: HashMap<String, Vec<RenderedFile>> = HashMap::new();
    if captures.is_empty() {
        return Ok(found);
    }
    let mut query =
        sql("SELECT capture, file, key, bytes, sha256 FROM capture_objects WHERE capture IN (");
    query.push_all(captures.iter().copied());
    query.push(") UNION ALL SELECT id AS capture, ");
    query.push_bind(FRAMES);
    query.push(
        " AS file, shard_key AS key, shard_bytes AS bytes, shard_sha256 AS sha256
          FROM captures WHERE shard_key IS NOT NULL AND id IN (",
    );
    query.push_all(captures.iter().copied());
    query.push(") ORDER BY file");
    for row in query.rows(tx, "listing the files of captures").await? {
        let file = RenderedFile {
            file: row.text("file")?,
            object: row.object("key", "bytes", "sha256")?,
        };
        found.entry(row.text("capture")?).or_default().push(file);
    }
    Ok(found)
}
