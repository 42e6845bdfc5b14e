//! Inputs of a job, resolved from the catalogue in the transaction of its lease: a worker needs no other
//! calls, and nothing can change between its lease and its inputs.

use super::{
    captures, checkpoints, consents, leaving, models, outputs, pins, subjects, upload_parts,
};
use crate::db::Tx;
use crate::rules::best::to_use;
use crate::{StoreError, StoredPart, Tenant, UploadedFile};
use std::collections::HashMap;
use yoto_proto::names::{Collection, NameError};
use yoto_proto::tiers;
use yoto_proto::v1::{Checkpoint, IngestSpec, JobSpec, RenderedFile, job_spec};
use yoto_proto::worker::v1::{InputFile, InputPiece, Inputs, OtherModel, SubjectShard};

/// Number of checkpoints in a lease: the one to use, and others in case that one is damaged.
const CHECKPOINTS: usize = 8;

/// The inputs of a leased job.
pub(crate) async fn resolve(
    tx: &mut Tx,
    tenant: &Tenant,
    job_id: &str,
    spec: &JobSpec,
) -> Result<Inputs, StoreError> {
    let (model, wanted, tradeoff) = match &spec.kind {
        Some(job_spec::Kind::Ingest(ingest)) => return ingest_inputs(tx, tenant, ingest).await,
        Some(job_spec::Kind::Train(train)) => (&train.model, None, false),
        Some(job_spec::Kind::Render(it)) => {
            let tradeoff = it.quality.as_ref().is_some_and(tiers::needs_tradeoff);
            (&it.model, Some(&*it.checkpoint), tradeoff)
        }
        Some(job_spec::Kind::Evaluate(it)) => (&it.model, Some(&*it.checkpoint), false),
        Some(job_spec::Kind::Export(it)) => (&it.model, Some(&*it.checkpoint), false),
        None => return Err(unreadable("the job has no kind")),
    };
    let id = parse(Collection::Models, model)?.to_owned();
    let model = models::get(tx, tenant, &id).await?;
    let mut shards = Vec::new();
    for subject in pins::people(spec, &model) {
        shards.push(shard(tx, tenant, job_id, &subject).await?);
    }
    let all = checkpoints::list(tx, tenant, &id, u32::MAX).await?;
    let mut checkpoints = match wanted {
        Some(wanted) => {
            let pinned = pins::of_job(tx, job_id).await?;
            pinned_first(to_use(all, wanted, tradeoff), pinned)
        }
        None => all,
    };
    match &spec.kind {
        Some(job_spec::Kind::Train(train)) if !train.leave.is_empty() => {
            let subject = parse(Collection::Subjects, &train.leave)?;
            let slot = leaving::slot_of(&model, subject);
            checkpoints
                .retain(|it| slot.is_some_and(|slot| leaving::is_rewritten(it, &model, slot)));
        }
        _ => checkpoints.truncate(CHECKPOINTS),
    }
    Ok(Inputs {
        files: Vec::new(),
        parts: Vec::new(),
        model: Some(model),
        shards,
        checkpoints,
        outputs: committed(tx, job_id, spec).await?,
        other_models: other_models(tx, tenant, job_id, spec).await?,
        rights: rights(tx, tenant, spec).await?,
    })
}

/// What the person of an export agrees to.
async fn rights(tx: &mut Tx, tenant: &Tenant, spec: &JobSpec) -> Result<String, StoreError> {
    match &spec.kind {
        Some(job_spec::Kind::Export(export)) => {
            let subject = parse(Collection::Subjects, &export.subject)?;
            consents::in_words(tx, tenant, subject).await
        }
        _ => Ok(String::new()),
    }
}

/// The other models with people that a job shows, each with its chosen checkpoint first.
async fn other_models(
    tx: &mut Tx,
    tenant: &Tenant,
    job_id: &str,
    spec: &JobSpec,
) -> Result<Vec<OtherModel>, StoreError> {
    let mut others = Vec::new();
    for name in pins::others(spec) {
        let id = parse(Collection::Models, name)?;
        let all = checkpoints::list(tx, tenant, id, u32::MAX).await?;
        let pinned = pins::of_other(tx, job_id, id).await?;
        let mut checkpoints = pinned_first(to_use(all, "", false), pinned);
        checkpoints.truncate(CHECKPOINTS);
        others.push(OtherModel {
            model: Some(models::get(tx, tenant, id).await?),
            checkpoints,
        });
    }
    Ok(others)
}

async fn committed(
    tx: &mut Tx,
    job_id: &str,
    spec: &JobSpec,
) -> Result<Vec<RenderedFile>, StoreError> {
    match spec.kind {
        Some(job_spec::Kind::Render(_)) => outputs::list(tx, job_id).await,
        _ => Ok(Vec::new()),
    }
}

async fn ingest_inputs(
    tx: &mut Tx,
    tenant: &Tenant,
    ingest: &IngestSpec,
) -> Result<Inputs, StoreError> {
    let id = parse(Collection::Captures, &ingest.capture)?;
    let files = captures::files(tx, tenant, id).await?;
    let mut files: Vec<InputFile> = files.into_iter().map(input_file).collect();
    let index: HashMap<String, usize> = (files.iter().enumerate())
        .map(|(number, file)| (file.path.clone(), number))
        .collect();
    let mut parts = Vec::new();
    for StoredPart { id, part } in upload_parts::all(tx, id).await? {
        let number = parts.len() as u32;
        let mut is_needed = false;
        for piece in part.pieces {
            let Some(file) = index.get(&piece.file).and_then(|it| files.get_mut(*it)) else {
                continue;
            };
            if id.writer == 0 && file.bytes == part.object.bytes {
                // In the form that workers of earlier versions know.
                file.object = Some(part.object.clone());
                continue;
            }
            is_needed = true;
            file.pieces.push(InputPiece {
                part: number,
                start: piece.start,
                bytes: piece.bytes,
            });
        }
        if is_needed {
            parts.push(part.object);
        }
    }
    for file in &files {
        let bytes: u64 = file.pieces.iter().map(|piece| piece.bytes).sum();
        if file.object.is_none() && bytes != file.bytes {
            return Err(unreadable(&format!("{}: bytes are missing", file.path)));
        }
    }
    Ok(Inputs {
        files,
        parts,
        ..Inputs::default()
    })
}

/// An uploaded file as the input of its ingest job, without its pieces.
fn input_file(file: UploadedFile) -> InputFile {
    InputFile {
        path: file.path,
        bytes: file.bytes,
        sha256: file.sha256,
        ..InputFile::default()
    }
}

/// The shard of the capture that was pinned to the job. A person who joined the model after the job was queued
/// has no pinned capture, and gets their newest one.
async fn shard(
    tx: &mut Tx,
    tenant: &Tenant,
    job_id: &str,
    subject: &str,
) -> Result<SubjectShard, StoreError> {
    let id = parse(Collection::Subjects, subject)?;
    let capture = match pins::capture(tx, job_id, id).await? {
        Some(capture) => capture,
        None => pins::pin_capture(tx, tenant, job_id, id).await?,
    };
    let shard = subjects::shard_of(tx, &capture).await?;
    shard.ok_or_else(|| unreadable(&format!("{subject} no longer has a shard")))
}

/// The checkpoints, with the one of the `pinned` step first; that one is kept while the job runs.
fn pinned_first(mut all: Vec<Checkpoint>, pinned: Option<u64>) -> Vec<Checkpoint> {
    let index = all.iter().position(|it| Some(it.step) == pinned);
    if let Some(index) = index {
        let used = all.remove(index);
        all.insert(0, used);
    }
    all
}

fn parse(collection: Collection, name: &str) -> Result<&str, StoreError> {
    collection
        .parse(name)
        .map_err(|error: NameError| unreadable(&error.to_string()))
}

/// These names and shards were checked when the job was queued.
fn unreadable(detail: &str) -> StoreError {
    StoreError::Corrupt {
        what: "spec",
        detail: detail.to_owned(),
    }
}
