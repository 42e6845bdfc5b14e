//! Folders of the object store that nothing refers to.
//!
//! A folder without a reference never gets one again: new rows name only folders of a running lease, and tokens
//! only grow. The files of a rejected capture are the exception: they are released, under the lock of the capture,
//! before they are removed, and are not read again after that. A folder that was noted as deleted is never named again
//! either.

use super::steps::age;
use super::upload_parts;
use crate::db::{Lock, Tx, sql};
use crate::{KnownGarbage, Reference, StoreError};
use yoto_proto::keys::{self, FolderOwner, Lease};

/// Notes a folder, with everything below it, as part of a deleted resource.
pub(crate) async fn deleted(tx: &mut Tx, folder: &str) -> Result<(), StoreError> {
    sql(
        "INSERT INTO garbage (folder, deleted, garbage_since) VALUES ($1, 1, $2)
         ON CONFLICT (folder) DO UPDATE SET deleted = 1",
    )
    .bind(folder)
    .bind(tx.now())
    .execute(tx, "noting deleted objects")
    .await?;
    Ok(())
}

/// Whether exactly this folder was noted as deleted.
pub(crate) async fn is_deleted(tx: &mut Tx, folder: &str) -> Result<bool, StoreError> {
    sql("SELECT EXISTS (SELECT 1 FROM garbage WHERE folder = $1 AND deleted = 1) AS found")
        .bind(folder)
        .one(tx, "looking for deleted objects")
        .await?
        .flag("found")
}

/// All noted folders.
pub(crate) async fn known(tx: &mut Tx, at: f64) -> Result<Vec<KnownGarbage>, StoreError> {
    let rows = sql(concat!(
        "SELECT folder, deleted, ",
        age!("garbage_since"),
        " AS age FROM garbage"
    ))
    .bind(at)
    .rows(tx, "listing garbage")
    .await?;
    rows.iter()
        .map(|row| {
            Ok(KnownGarbage {
                folder: row.text("folder")?,
                deleted: row.flag("deleted")?,
                age: row.real("age")?.unwrap_or_default(),
            })
        })
        .collect()
}

/// Notes `new` folders and forgets those that are `gone`.
pub(crate) async fn note(tx: &mut Tx, new: &[String], gone: &[String]) -> Result<(), StoreError> {
    for folder in new {
        sql(
            "INSERT INTO garbage (folder, deleted, garbage_since) VALUES ($1, 0, $2)
             ON CONFLICT (folder) DO NOTHING",
        )
        .bind(folder)
        .bind(tx.now())
        .execute(tx, "noting garbage")
        .await?;
    }
    for folder in gone {
        sql("DELETE FROM garbage WHERE folder = $1")
            .bind(folder)
            .execute(tx, "forgetting garbage")
            .await?;
    }
    Ok(())
}

/// Forgets that these folders, and those below them, were noted.
pub(crate) async fn forget(tx: &mut Tx, folders: &[String]) -> Result<(), StoreError> {
    for folder in folders {
        sql("DELETE FROM garbage WHERE folder = $1 OR substr(folder, 1, length($2)) = $2")
            .bind(folder)
            .bind(format!("{folder}/"))
            .execute(tx, "forgetting garbage")
            .await?;
    }
    Ok(())
}

/// The reference to each of `folders`. A folder of an unknown kind counts as in use, and so does an ingested
/// upload until `keep_uploads` seconds after its last write.
pub(crate) async fn references(
    tx: &mut Tx,
    folders: &[String],
    keep_uploads: f64,
    at: f64,
) -> Result<Vec<Reference>, StoreError> {
    let mut references = Vec::with_capacity(folders.len());
    for key in folders {
        let reference = match FolderOwner::parse(key) {
            None => Reference::Row,
            Some(folder) => {
                // In this order: a job that ends between the two has left its row before the second.
                let runs = runs(tx, folder.lease()).await?;
                match (named(tx, key, folder, keep_uploads, at).await?, runs) {
                    (true, _) => Reference::Row,
                    (false, true) => Reference::Lease,
                    (false, false) => Reference::Nothing,
                }
            }
        };
        references.push(reference);
    }
    Ok(references)
}

/// Notes that the files of an upload are removed now. Returns `false` if a row has named them since they were found to be
/// garbage; they are kept then.
pub(crate) async fn release_upload(
    tx: &mut Tx,
    capture: &str,
    keep_uploads: f64,
    at: f64,
) -> Result<bool, StoreError> {
    tx.lock(Lock::Capture(capture)).await?;
    let key = keys::upload_folder(capture);
    let owner = FolderOwner::Upload { capture };
    if named(tx, &key, owner, keep_uploads, at).await? {
        return Ok(false);
    }
    sql("UPDATE captures SET files_removed = 1 WHERE id = $1")
        .bind(capture)
        .execute(tx, "releasing the files of an upload")
        .await?;
    upload_parts::forget(tx, capture).await?;
    Ok(true)
}

/// Whether a row names objects of the folder `key`. The files of an upload are needed until an ingest job has
/// read them, and kept for a while after that: they may be the only copy until a person has checked the result.
async fn named(
    tx: &mut Tx,
    key: &str,
    folder: FolderOwner<'_>,
    keep_uploads: f64,
    at: f64,
) -> Result<bool, StoreError> {
    let inside = format!("{key}/");
    let statement = match folder {
        FolderOwner::Upload { capture } => sql(concat!(
            "SELECT EXISTS (SELECT 1 FROM captures
                     WHERE id = $2 AND (state IN ('UPLOADING', 'UPLOADED', 'INGESTING')
                         OR (state = 'READY' AND ",
            age!("idle_since"),
            " < $3))) AS found"
        ))
        .bind(at)
        .bind(capture)
        .bind(keep_uploads),
        FolderOwner::Shard { capture, .. } => sql("SELECT EXISTS (SELECT 1 FROM captures
                     WHERE id = $1 AND substr(shard_key, 1, length($2)) = $2) AS found")
        .bind(capture)
        .bind(inside),
        FolderOwner::Checkpoint { model, by } => {
            sql("SELECT EXISTS (SELECT 1 FROM checkpoints WHERE model = $1
                         AND (substr(manifest_key, 1, length($2)) = $2
                              OR substr(tradeoff_key, 1, length($2)) = $2))
                     OR EXISTS (SELECT 1 FROM jobs WHERE id = $3 AND lease = $4
                         AND kind = 'evaluate' AND state = 'SUCCEEDED') AS found")
            .bind(model)
            .bind(inside)
            .bind(by.job)
            .bind(token(by))
        }
        FolderOwner::Render { by } => sql(
            "SELECT EXISTS (SELECT 1 FROM jobs WHERE id = $1 AND lease = $2
                         AND kind IN ('render', 'export') AND state = 'SUCCEEDED')
                     OR EXISTS (SELECT 1 FROM job_outputs WHERE job = $1
                         AND substr(key, 1, length($3)) = $3) AS found",
        )
        .bind(by.job)
        .bind(token(by))
        .bind(inside),
    };
    let row = statement.one(tx, "looking for references").await?;
    row.flag("found")
}

/// Whether exactly this lease of the job is current.
async fn runs(tx: &mut Tx, lease: Option<Lease<'_>>) -> Result<bool, StoreError> {
    let Some(lease) = lease else {
        return Ok(false);
    };
    sql("SELECT EXISTS (SELECT 1 FROM leases WHERE job = $1 AND token = $2) AS found")
        .bind(lease.job)
        .bind(token(lease))
        .one(tx, "looking for references")
        .await?
        .flag("found")
}

/// The token in the column's type. A token below 0 or beyond the range was never issued.
fn token(lease: Lease<'_>) -> i64 {
    i64::try_from(lease.token).unwrap_or(-1)
}
