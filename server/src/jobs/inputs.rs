//! What a leased job needs, resolved from the catalogue: a worker asks for nothing else.

use crate::{context::Context, error::RequestError, objects::upload, store::StoreError};
use yoto_proto::{
    names::{Collection, NameError},
    v1::{
        EvaluateSpec, IngestSpec, InputFile, Inputs, JobSpec, RenderSpec, SubjectShard, TrainSpec,
        job_spec, render_spec::What,
    },
};

/// How many checkpoints to hand out: the newest, and older ones in case it is torn.
const CHECKPOINTS: u32 = 8;

/// The inputs of a job.
pub async fn resolve(context: &Context, spec: &JobSpec) -> Result<Inputs, RequestError> {
    match &spec.kind {
        Some(job_spec::Kind::Ingest(ingest)) => ingest_inputs(context, ingest).await,
        Some(job_spec::Kind::Train(train)) => train_inputs(context, train).await,
        Some(job_spec::Kind::Render(render)) => render_inputs(context, render).await,
        Some(job_spec::Kind::Evaluate(evaluate)) => evaluate_inputs(context, evaluate).await,
        None => Err(unreadable("the job says no kind").into()),
    }
}

async fn ingest_inputs(context: &Context, ingest: &IngestSpec) -> Result<Inputs, RequestError> {
    let id = parse(Collection::Captures, &ingest.capture)?;
    let files = context.store.capture_files(id).await?;
    let files: Vec<InputFile> = files
        .iter()
        .map(|file| upload::input_file(id, file))
        .collect();
    Ok(Inputs {
        files,
        ..Inputs::default()
    })
}

async fn train_inputs(context: &Context, train: &TrainSpec) -> Result<Inputs, RequestError> {
    let id = parse(Collection::Models, &train.model)?;
    let model = context.store.model(id).await?;
    let mut shards = Vec::with_capacity(model.slots.len());
    for slot in &model.slots {
        shards.push(shard(context, &slot.subject).await?);
    }
    let checkpoints = context.store.checkpoints(id, CHECKPOINTS).await?;
    Ok(Inputs {
        model: Some(model),
        shards,
        checkpoints,
        ..Inputs::default()
    })
}

async fn render_inputs(context: &Context, render: &RenderSpec) -> Result<Inputs, RequestError> {
    let id = parse(Collection::Models, &render.model)?;
    let model = context.store.model(id).await?;
    let mut shards = vec![shard(context, &render.subject).await?];
    if let Some(What::Motion(motion)) = &render.what
        && motion.driver != render.subject
    {
        shards.push(shard(context, &motion.driver).await?);
    }
    let checkpoints = context.store.checkpoints(id, CHECKPOINTS).await?;
    Ok(Inputs {
        model: Some(model),
        shards,
        checkpoints,
        ..Inputs::default()
    })
}

async fn evaluate_inputs(
    context: &Context,
    evaluate: &EvaluateSpec,
) -> Result<Inputs, RequestError> {
    let id = parse(Collection::Models, &evaluate.model)?;
    let model = context.store.model(id).await?;
    let everybody = evaluate.subjects.is_empty();
    let mut shards = Vec::new();
    for slot in &model.slots {
        if everybody || evaluate.subjects.contains(&slot.subject) {
            shards.push(shard(context, &slot.subject).await?);
        }
    }
    let checkpoints = context.store.checkpoints(id, CHECKPOINTS).await?;
    Ok(Inputs {
        model: Some(model),
        shards,
        checkpoints,
        ..Inputs::default()
    })
}

async fn shard(context: &Context, subject: &str) -> Result<SubjectShard, RequestError> {
    let shard = context
        .store
        .shard(parse(Collection::Subjects, subject)?)
        .await?;
    shard.ok_or_else(|| unreadable(&format!("{subject} has no shard any more")).into())
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
