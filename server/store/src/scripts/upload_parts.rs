//! The bytes of uploads: parts are objects that are written once, and pieces say where the bytes of each file are.
//!
//! A part without a row belongs to nothing if its writer is not the upload's newest: only the newest commits, and numbers
//! of writers only grow.

use super::uploads::{get, not_found};
use crate::db::{Lock, Row, Tx, integer, sql};
use crate::{NewPart, NewPiece, PartId, StoreError, StoredPart, Tenant, UploadPart};
use yoto_objects::{Part, Piece};
use yoto_proto::v1::{ErrorReason, ObjectRef};

fn part(row: &Row) -> Result<UploadPart, StoreError> {
    Ok(UploadPart {
        id: PartId {
            writer: row.number("writer")?,
            number: row.number("number")?,
        },
        object: ObjectRef {
            key: row.text("key")?,
            bytes: row.number("bytes")?,
            sha256: row.text("sha256")?,
        },
    })
}

/// The newest part of an upload.
pub(crate) async fn newest(tx: &mut Tx, id: &str) -> Result<Option<UploadPart>, StoreError> {
    let row = sql(
        "SELECT writer, number, key, bytes, sha256 FROM upload_parts WHERE capture = $1
         ORDER BY writer DESC, number DESC LIMIT 1",
    )
    .bind(id)
    .row(tx, "looking for the newest part of an upload")
    .await?;
    row.as_ref().map(part).transpose()
}

/// The part of an upload with this id.
pub(crate) async fn find(
    tx: &mut Tx,
    id: &str,
    of: PartId,
) -> Result<Option<UploadPart>, StoreError> {
    let row = sql("SELECT writer, number, key, bytes, sha256 FROM upload_parts
         WHERE capture = $1 AND writer = $2 AND number = $3")
    .bind(id)
    .bind(integer("writer", of.writer)?)
    .bind(integer("number", of.number)?)
    .row(tx, "looking for a part of an upload")
    .await?;
    row.as_ref().map(part).transpose()
}

/// Number of pieces of an upload.
pub(crate) async fn pieces(tx: &mut Tx, id: &str) -> Result<u64, StoreError> {
    sql("SELECT count(*) AS pieces FROM upload_pieces WHERE capture = $1")
        .bind(id)
        .one(tx, "counting the pieces of an upload")
        .await?
        .number("pieces")
}

/// Whether `writer` is the newest one of the upload.
pub(crate) async fn is_newest(tx: &mut Tx, id: &str, writer: u64) -> Result<bool, StoreError> {
    sql("SELECT EXISTS (SELECT 1 FROM captures WHERE id = $1 AND writer = $2) AS found")
        .bind(id)
        .bind(integer("writer", writer)?)
        .one(tx, "looking for the newest writer of an upload")
        .await?
        .flag("found")
}

/// All parts of an upload in their order, each with its pieces.
pub(crate) async fn all(tx: &mut Tx, id: &str) -> Result<Vec<StoredPart>, StoreError> {
    let rows = sql(
        "SELECT writer, number, key, bytes, sha256 FROM upload_parts WHERE capture = $1
         ORDER BY writer, number",
    )
    .bind(id)
    .rows(tx, "listing the parts of an upload")
    .await?;
    let parts = rows.iter().map(|row| {
        let UploadPart { id, object } = part(row)?;
        let pieces = Vec::new();
        let part = Part { object, pieces };
        Ok(StoredPart { id, part })
    });
    let mut parts: Vec<StoredPart> = parts.collect::<Result<_, StoreError>>()?;
    let rows = sql(
        "SELECT writer, number, path, start, bytes, part_start FROM upload_pieces WHERE capture = $1
         ORDER BY writer, number, part_start",
    )
    .bind(id)
    .rows(tx, "listing the pieces of an upload")
    .await?;
    let mut at = parts.iter_mut().peekable();
    for row in &rows {
        let of = PartId {
            writer: row.number("writer")?,
            number: row.number("number")?,
        };
        while at.next_if(|it| it.id < of).is_some() {}
        let Some(stored) = at.peek_mut().filter(|it| it.id == of) else {
            return Err(StoreError::Corrupt {
                what: "upload_pieces",
                detail: format!("part {}-{} is missing", of.writer, of.number),
            });
        };
        stored.part.pieces.push(Piece {
            file: row.text("path")?,
            offset: row.number("start")?,
            start: row.number("part_start")?,
            bytes: row.number("bytes")?,
        });
    }
    Ok(parts)
}

/// Records a part that its writer has put into the object store. Each piece begins where the committed bytes of its file
/// end.
pub(crate) async fn commit(
    tx: &mut Tx,
    tenant: &Tenant,
    id: &str,
    part: &NewPart,
) -> Result<(), StoreError> {
    tx.lock(Lock::Capture(id)).await?;
    let done = sql(
        "UPDATE captures SET idle_since = $2 WHERE id = $1 AND state = 'UPLOADING' AND writer = $4
             AND subject IN (SELECT id FROM subjects WHERE tenant = $3)",
    )
    .bind(id)
    .bind(tx.now())
    .bind(tenant.id())
    .bind(integer("writer", part.id.writer)?)
    .execute(tx, "noting the write of an upload")
    .await?;
    if done == 0 {
        get(tx, tenant, id).await?;
        // A finished upload has no writer any more; whoever was taken over before learns that.
        return match is_newest(tx, id, part.id.writer).await? {
            true => Err(not_found(id)),
            false => Err(StoreError::taken_over(id)),
        };
    }
    insert(tx, id, part).await?;
    let length = |piece: &NewPiece| piece.to.saturating_sub(piece.from);
    let new: u64 = part.pieces.iter().map(length).sum();
    // After the bytes of the replaced part.
    let mut start = part.object.bytes.saturating_sub(new);
    let mut rows = sql(
        "INSERT INTO upload_pieces (capture, path, start, bytes, writer, number, part_start) VALUES ",
    );
    let mut count = 0;
    for piece in &part.pieces {
        advance(tx, id, piece).await?;
        // Only the first one can go on with a piece of the replaced part.
        if count > 0 || part.replaces.is_none() || !extend(tx, id, part.id, piece, start).await? {
            rows.push(if count == 0 { "(" } else { ", (" });
            rows.push_bind(id);
            rows.push(", ");
            rows.push_bind(&piece.path);
            for number in [
                piece.from,
                length(piece),
                part.id.writer,
                part.id.number,
                start,
            ] {
                rows.push(", ");
                rows.push_bind(integer("offset", number)?);
            }
            rows.push(")");
            count += 1;
        }
        start += length(piece);
    }
    if count > 0 {
        rows.execute(tx, "recording the pieces of a part").await?;
    }
    Ok(())
}

/// Records a part without new pieces. Those of the part that it replaces are its first ones.
async fn insert(tx: &mut Tx, id: &str, part: &NewPart) -> Result<(), StoreError> {
    sql(
        "INSERT INTO upload_parts (capture, writer, number, key, bytes, sha256)
         VALUES ($1, $2, $3, $4, $5, $6)",
    )
    .bind(id)
    .bind(integer("writer", part.id.writer)?)
    .bind(integer("number", part.id.number)?)
    .bind(&part.object.key)
    .bind(integer("bytes", part.object.bytes)?)
    .bind(&part.object.sha256)
    .execute(tx, "recording a part of an upload")
    .await?;
    let Some(replaced) = part.replaces else {
        return Ok(());
    };
    sql("UPDATE upload_pieces SET writer = $4, number = $5
         WHERE capture = $1 AND writer = $2 AND number = $3")
    .bind(id)
    .bind(integer("writer", replaced.writer)?)
    .bind(integer("number", replaced.number)?)
    .bind(integer("writer", part.id.writer)?)
    .bind(integer("number", part.id.number)?)
    .execute(tx, "moving the pieces of a part")
    .await?;
    let done = sql("DELETE FROM upload_parts WHERE capture = $1 AND writer = $2 AND number = $3")
        .bind(id)
        .bind(integer("writer", replaced.writer)?)
        .bind(integer("number", replaced.number)?)
        .execute(tx, "replacing a part of an upload")
        .await?;
    match done {
        1 => Ok(()),
        _ => Err(StoreError::Corrupt {
            what: "upload_parts",
            detail: format!("part {}-{} is missing", replaced.writer, replaced.number),
        }),
    }
}

/// Counts the bytes of `piece` as committed.
async fn advance(tx: &mut Tx, id: &str, piece: &NewPiece) -> Result<(), StoreError> {
    let NewPiece { path, from, to } = piece;
    let done = sql("UPDATE capture_files SET committed = $4
         WHERE capture = $1 AND path = $2 AND committed = $3 AND $3 < $4 AND $4 <= bytes")
    .bind(id)
    .bind(path)
    .bind(integer("offset", *from)?)
    .bind(integer("offset", *to)?)
    .execute(tx, "committing a part of an upload")
    .await?;
    match done {
        0 => Err(StoreError::Rule {
            reason: ErrorReason::UploadOffset,
            message: format!("{path}: bytes {from} to {to} do not follow what was committed"),
        }),
        _ => Ok(()),
    }
}

/// Lengthens the piece of the same file that ends in the part where this one begins, at `start`. Returns whether there is
/// one.
async fn extend(
    tx: &mut Tx,
    id: &str,
    part: PartId,
    piece: &NewPiece,
    start: u64,
) -> Result<bool, StoreError> {
    let done = sql("UPDATE upload_pieces SET bytes = bytes + $7
         WHERE capture = $1 AND path = $2 AND writer = $3 AND number = $4
             AND start + bytes = $5 AND part_start + bytes = $6")
    .bind(id)
    .bind(&piece.path)
    .bind(integer("writer", part.writer)?)
    .bind(integer("number", part.number)?)
    .bind(integer("offset", piece.from)?)
    .bind(integer("offset", start)?)
    .bind(integer("offset", piece.to.saturating_sub(piece.from))?)
    .execute(tx, "lengthening a piece of an upload")
    .await?;
    Ok(done > 0)
}

/// Forgets the bytes of files that `writer` found to be lost, or to differ from the announced ones. If another writer has
/// taken over or the upload has ended, nothing changes.
pub(crate) async fn restart(
    tx: &mut Tx,
    tenant: &Tenant,
    id: &str,
    writer: u64,
    paths: &[String],
) -> Result<(), StoreError> {
    tx.lock(Lock::Capture(id)).await?;
    for path in paths {
        let done = sql(
            "UPDATE capture_files SET committed = 0 WHERE capture = $1 AND path = $2
                 AND capture IN (SELECT c.id FROM captures c JOIN subjects s ON s.id = c.subject
                                 WHERE s.tenant = $3 AND c.writer = $4 AND c.state = 'UPLOADING')",
        )
        .bind(id)
        .bind(path)
        .bind(tenant.id())
        .bind(integer("writer", writer)?)
        .execute(tx, "starting a file of an upload anew")
        .await?;
        if done == 0 {
            return Ok(());
        }
        sql("DELETE FROM upload_pieces WHERE capture = $1 AND path = $2")
            .bind(id)
            .bind(path)
            .execute(tx, "forgetting the pieces of a file")
            .await?;
    }
    sql(
        "DELETE FROM upload_parts WHERE capture = $1 AND NOT EXISTS (
             SELECT 1 FROM upload_pieces q WHERE q.capture = upload_parts.capture
                 AND q.writer = upload_parts.writer AND q.number = upload_parts.number)",
    )
    .bind(id)
    .execute(tx, "forgetting parts without pieces")
    .await?;
    Ok(())
}

/// Forgets all parts of a capture whose files are removed.
pub(crate) async fn forget(tx: &mut Tx, id: &str) -> Result<(), StoreError> {
    sql("DELETE FROM upload_parts WHERE capture = $1")
        .bind(id)
        .execute(tx, "forgetting the parts of an upload")
        .await?;
    Ok(())
}

/// Those of `ids` that belong to nothing: they have no row, and their writers are not the newest of the upload.
pub(crate) async fn orphans(
    tx: &mut Tx,
    id: &str,
    ids: &[PartId],
) -> Result<Vec<PartId>, StoreError> {
    let row = sql("SELECT writer FROM captures WHERE id = $1")
        .bind(id)
        .row(tx, "looking for the newest writer of an upload")
        .await?;
    let Some(row) = row else {
        return Ok(Vec::new());
    };
    let newest: u64 = row.number("writer")?;
    // After the writer was read: what its predecessors have committed has a row now.
    let rows = sql("SELECT writer, number FROM upload_parts WHERE capture = $1")
        .bind(id)
        .rows(tx, "listing the parts of an upload")
        .await?;
    let named = rows.iter().map(|row| {
        Ok(PartId {
            writer: row.number("writer")?,
            number: row.number("number")?,
        })
    });
    let named: std::collections::HashSet<PartId> = named.collect::<Result<_, StoreError>>()?;
    let mut orphans = ids.to_vec();
    orphans.retain(|it| it.writer < newest && !named.contains(it));
    Ok(orphans)
}
