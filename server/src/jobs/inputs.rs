//! Inputs of a leased job, resolved from the catalogue: a worker needs no other calls.

use crate::{
    checkpoints::best::to_use, context::Context, error::RequestError, objects::upload,
    store::StoreError,
};
use yoto_proto::{
    names::{Collection, NameError},
    render_needs::needs,
    v1::{Checkpoint, IngestSpec, InputFile, Inputs, JobSpec, Model, SubjectShard, job_spec},
};

/// Number of checkpoints in a lease: the one to use, and others in case it is damaged.
const CHECKPOINTS: usize = 8;

/// The inputs of the job `job_id`, which is leased.
pub async fn resolve(
    context: &Context,
    job_id: &str,
    spec: &JobSpec,
) -> Result<Inputs, RequestError> {
    let pinned = context.store.pinned_step(job_id).await?;
    match &spec.kind {
        Some(job_spec::Kind::Ingest(ingest)) => ingest_inputs(context, ingest).await,
        Some(job_spec::Kind::Train(train)) => {
            of_model(context, &train.model, everybody, |all| all).await
        }
        Some(job_spec::Kind::Render(render)) => {
            let people = |_: &Model| {
                let mut people: Vec<String> = Vec::new();
                for need in needs(render) {
                    if !people.iter().any(|it| it == need.subject) {
                        people.push(need.subject.to_owned());
                    }
                }
                people
            };
            let kept = |all| {
                let tradeoff = render.quality.is_some();
                pinned_first(to_use(all, &render.checkpoint, tradeoff), pinned)
            };
            of_model(context, &render.model, people, kept).await
        }
        Some(job_spec::Kind::Evaluate(evaluate)) => {
            let people = |model: &Model| {
                let asked =
                    |it: &String| evaluate.subjects.is_empty() || evaluate.subjects.contains(it);
                everybody(model).into_iter().filter(asked).collect()
            };
            let kept = |all| pinned_first(to_use(all, &evaluate.checkpoint, false), pinned);
            of_model(context, &evaluate.model, people, kept).await
        }
        None => Err(unreadable("the job has no kind").into()),
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

/// The model called `name`, the shards of the subjects that `people` names, and the checkpoints
/// that `kept` selects.
async fn of_model(
    context: &Context,
    name: &str,
    people: impl FnOnce(&Model) -> Vec<String>,
    kept: impl FnOnce(Vec<Checkpoint>) -> Vec<Checkpoint>,
) -> Result<Inputs, RequestError> {
    let id = parse(Collection::Models, name)?;
    let model = context.store.model(id).await?;
    let mut shards = Vec::new();
    for subject in people(&model) {
        shards.push(shard(context, &subject).await?);
    }
    let mut checkpoints = kept(context.store.checkpoints(id, u32::MAX).await?);
    checkpoints.truncate(CHECKPOINTS);
    Ok(Inputs {
        model: Some(model),
        shards,
        checkpoints,
        ..Inputs::default()
    })
}

fn everybody(model: &Model) -> Vec<String> {
    model.slots.iter().map(|it| it.subject.clone()).collect()
}

/// With the checkpoint of the `pinned` step, which stays while the job runs, first.
fn pinned_first(mut all: Vec<Checkpoint>, pinned: Option<u64>) -> Vec<Checkpoint> {
    let place = all.iter().position(|it| Some(it.step) == pinned);
    if let Some(place) = place {
        let used = all.remove(place);
        all.insert(0, used);
    }
    all
}

async fn shard(context: &Context, subject: &str) -> Result<SubjectShard, RequestError> {
    let shard = context
        .store
        .shard(parse(Collection::Subjects, subject)?)
        .await?;
    shard.ok_or_else(|| unreadable(&format!("{subject} no longer has a shard")).into())
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
