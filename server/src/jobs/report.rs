//! Reports of workers on their leased jobs: checked by [`super::checks`] before they enter the catalogue.

use super::checks::parse;
use super::checks::results::{check_result, require};
use crate::context::Context;
use crate::objects::checksum::is_sha256;
use crate::objects::manifest;
use yoto_process::metrics::METRICS;
use yoto_proto::checks::scene::MAX_PICTURES;
use yoto_proto::keys;
use yoto_proto::names::{self, Collection};
use yoto_proto::v1::{Checkpoint, Progress, RenderedFile, job_spec};
use yoto_request::RequestError;
use yoto_store::{Ending, LeaseKey, StoreError, TakenRange, Tenant};

/// Extends the lease and records progress. Returns whether the job is to be cancelled.
///
/// # Errors
/// When the lease is stale.
pub(crate) async fn heartbeat(
    context: &Context,
    tenant: &Tenant,
    lease: &LeaseKey,
    progress: Option<Progress>,
) -> Result<bool, RequestError> {
    let seconds = context.config.lease_seconds;
    let reported = progress.clone();
    let cancel = context
        .store
        .heartbeat(tenant, lease, progress, seconds)
        .await?;
    // Jobs of other kinds train for no time.
    if let Some(progress) = reported.filter(|it| it.train_seconds > 0.0) {
        let job = Collection::Jobs.name(&lease.job_id);
        METRICS.trainings.reported(&job, &progress);
    }
    announce(context, lease);
    Ok(cancel)
}

/// Makes a checkpoint the model's newest. Its worker took `save_seconds` from the end of the step; 0: it does not say.
///
/// # Errors
/// When the lease is stale, or the checkpoint is not one of this job and lease.
pub(crate) async fn publish(
    context: &Context,
    tenant: &Tenant,
    lease: &LeaseKey,
    checkpoint: Checkpoint,
    save_seconds: f64,
) -> Result<(), RequestError> {
    let Some(job_spec::Kind::Train(train)) = context.store.leased_spec(tenant, lease).await?.kind
    else {
        return Err(RequestError::invalid(
            "job",
            "only a train job publishes checkpoints",
        ));
    };
    let step = checkpoint.step;
    if checkpoint.name != names::checkpoint(&train.model, step) {
        let message = format!(
            "'{}' is not step {step} of {}",
            checkpoint.name, train.model
        );
        return Err(RequestError::invalid("checkpoint.name", message));
    }
    if checkpoint.psnr.is_some_and(|psnr| !psnr.is_finite()) {
        return Err(RequestError::invalid("checkpoint.psnr", "is not finite"));
    }
    let model_id = parse(Collection::Models, "job", &train.model)?;
    let model = context.store.model(tenant, model_id).await?;
    let known = |slot: &u32| model.slots.iter().any(|it| it.slot == *slot);
    let slots = &checkpoint.slots;
    if !slots.is_sorted_by(|a, b| a < b) || !slots.iter().all(known) {
        let message = format!("{slots:?} are not rising slots of {}", train.model);
        return Err(RequestError::invalid("checkpoint.slots", message));
    }
    if !checkpoint.shards.iter().all(|sha256| is_sha256(sha256)) {
        let message = "has something else than a SHA-256 in lower-case hex";
        return Err(RequestError::invalid("checkpoint.shards", message));
    }
    let folder = keys::checkpoint(model_id, &lease.job_id, lease.token, step);
    let in_folder = |key: &str| key.starts_with(&format!("{folder}/"));
    require(
        context,
        "checkpoint.manifest",
        checkpoint.manifest.as_ref(),
        in_folder,
    )
    .await?;
    if let Some(object) = &checkpoint.manifest {
        manifest::check(context, object).await?;
    }
    let default = context.config.storage.retention();
    let bytes = checkpoint.bytes;
    let published = context
        .store
        .publish_checkpoint(tenant, lease, checkpoint, default);
    published.await?;
    METRICS.checkpoint(bytes, save_seconds);
    tracing::info!(job = lease.job_id, step, "checkpoint published");
    Ok(())
}

/// Commits a file of a render or an export.
///
/// # Errors
/// When the lease is stale, or the file is not one of this job and lease.
pub(crate) async fn commit_output(
    context: &Context,
    tenant: &Tenant,
    lease: &LeaseKey,
    file: &RenderedFile,
) -> Result<(), RequestError> {
    let kind = context.store.leased_spec(tenant, lease).await?.kind;
    let commits = matches!(
        kind,
        Some(job_spec::Kind::Render(_) | job_spec::Kind::Export(_))
    );
    if !commits {
        return Err(RequestError::invalid(
            "claim.job",
            "only a render or an export commits files",
        ));
    }
    let expected = keys::render(&lease.job_id, lease.token, &file.file);
    let is_expected = |key: &str| key == expected;
    require(context, "file.object", file.object.as_ref(), is_expected).await?;
    context.store.commit_output(tenant, lease, file).await?;
    announce(context, lease);
    Ok(())
}

/// Assigns up to `pictures` further pictures of a render to the lease.
///
/// # Errors
/// When the lease is stale, or not of a render.
pub(crate) async fn take_range(
    context: &Context,
    tenant: &Tenant,
    lease: &LeaseKey,
    pictures: u32,
    drawn: Option<u32>,
) -> Result<TakenRange, RequestError> {
    let Some(job_spec::Kind::Render(_)) = context.store.leased_spec(tenant, lease).await?.kind
    else {
        return Err(RequestError::invalid(
            "claim.job",
            "only a render has pictures",
        ));
    };
    if !(1..=MAX_PICTURES).contains(&pictures) {
        let message = format!("{pictures} is not between 1 and {MAX_PICTURES}");
        return Err(RequestError::invalid("pictures", message));
    }
    Ok(context
        .store
        .take_range(tenant, lease, pictures, drawn)
        .await?)
}

/// Ends a lease: with the job's result, without one, or for another worker.
///
/// # Errors
/// When the lease is stale, the result is not one of this job and lease, or the worker reports a cancel
/// that was never requested. A repeated call is accepted.
pub(crate) async fn end(
    context: &Context,
    tenant: &Tenant,
    lease: &LeaseKey,
    ending: Ending,
) -> Result<(), RequestError> {
    if let Ending::Succeeded(result) = &ending {
        match context.store.leased_spec(tenant, lease).await {
            Ok(spec) => check_result(context, tenant, lease, &spec, result).await?,
            // The store knows whether it is a repeated call.
            Err(StoreError::StaleLease { .. }) => {}
            Err(error) => return Err(error.into()),
        }
    }
    context.store.end_job(tenant, lease, ending.clone()).await?;
    let job = Collection::Jobs.name(&lease.job_id);
    METRICS.trainings.ended(&job);
    context.notifier.announce_end(&job);
    let outcome = ending.outcome().as_str_name();
    tracing::info!(
        job = lease.job_id,
        token = lease.token,
        outcome,
        "lease ended"
    );
    Ok(())
}

fn announce(context: &Context, lease: &LeaseKey) {
    let job = Collection::Jobs.name(&lease.job_id);
    context.notifier.announce(&job);
}
