//! Every object that a row names. Where a folder of objects is kept for a row, see `garbage`.

use crate::db::{Row, Tx, sql};
use crate::{References, StoreError};
use yoto_proto::names::{self, Collection};
use yoto_proto::v1::{JobResult, ObjectRef, job_result};

/// All references, of all tenants, as of one snapshot.
pub(crate) async fn all(tx: &mut Tx) -> Result<References, StoreError> {
    let mut found = References::default();
    of_captures(tx, &mut found).await?;
    of_checkpoints(tx, &mut found).await?;
    of_jobs(tx, &mut found).await?;
    let rows = sql("SELECT job, token FROM leases")
        .rows(tx, "listing leases")
        .await?;
    for row in &rows {
        found
            .leases
            .insert((row.text("job")?, row.number("token")?));
    }
    let rows = sql("SELECT id, writer FROM captures WHERE state = 'UPLOADING'")
        .rows(tx, "listing open uploads")
        .await?;
    for row in &rows {
        found.writers.insert(row.text("id")?, row.number("writer")?);
    }
    Ok(found)
}

async fn of_captures(tx: &mut Tx, found: &mut References) -> Result<(), StoreError> {
    let action = "listing the objects of captures";
    let statements = [
        "SELECT id AS capture, shard_key AS key, shard_bytes AS bytes, shard_sha256 AS sha256 FROM captures
         WHERE shard_key IS NOT NULL",
        "SELECT capture, key, bytes, sha256 FROM capture_objects",
        "SELECT capture, key, bytes, sha256 FROM upload_parts",
    ];
    for statement in statements {
        for row in &sql(statement).rows(tx, action).await? {
            let of = Collection::Captures.name(&row.text("capture")?);
            found.add(of, object(row)?);
        }
    }
    Ok(())
}

async fn of_checkpoints(tx: &mut Tx, found: &mut References) -> Result<(), StoreError> {
    let rows = sql(
        "SELECT model, step, manifest_key, manifest_bytes, manifest_sha256,
             tradeoff_key, tradeoff_bytes, tradeoff_sha256 FROM checkpoints",
    )
    .rows(tx, "listing the objects of checkpoints")
    .await?;
    for row in &rows {
        let model = Collection::Models.name(&row.text("model")?);
        let of = names::checkpoint(&model, row.number("step")?);
        let manifest = row.object("manifest_key", "manifest_bytes", "manifest_sha256")?;
        found.add_manifest(of.clone(), manifest);
        let tradeoff = row.object("tradeoff_key", "tradeoff_bytes", "tradeoff_sha256")?;
        found.add(of, tradeoff);
    }
    Ok(())
}

async fn of_jobs(tx: &mut Tx, found: &mut References) -> Result<(), StoreError> {
    let action = "listing the objects of jobs";
    let rows = sql("SELECT job, key, bytes, sha256 FROM job_outputs");
    for row in &rows.rows(tx, action).await? {
        let of = Collection::Jobs.name(&row.text("job")?);
        found.add(of, object(row)?);
    }
    let rows = sql("SELECT id, result FROM jobs WHERE result IS NOT NULL AND state = 'SUCCEEDED'");
    for row in &rows.rows(tx, action).await? {
        let of = Collection::Jobs.name(&row.text("id")?);
        let result: Option<JobResult> = row.message("result")?;
        for object in of_result(result.and_then(|it| it.kind)) {
            found.add(of.clone(), Some(object));
        }
    }
    Ok(())
}

fn object(row: &Row) -> Result<Option<ObjectRef>, StoreError> {
    row.object("key", "bytes", "sha256")
}

/// The objects that the result of a job names.
fn of_result(result: Option<job_result::Kind>) -> Vec<ObjectRef> {
    match result {
        Some(job_result::Kind::Ingest(it)) => {
            let made = [it.shard, it.check, it.thumbnail];
            made.into_iter().flatten().collect()
        }
        Some(job_result::Kind::Render(it)) => {
            it.files.into_iter().filter_map(|it| it.object).collect()
        }
        Some(job_result::Kind::Export(it)) => {
            it.files.into_iter().filter_map(|it| it.object).collect()
        }
        Some(job_result::Kind::Evaluate(it)) => it.tradeoff.into_iter().collect(),
        // Its checkpoint has a row.
        Some(job_result::Kind::Train(_)) | None => Vec::new(),
    }
}
