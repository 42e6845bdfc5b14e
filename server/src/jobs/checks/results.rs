//! Checks of what workers report: keys must be those that the job may write under the lease's token, and
//! the objects must exist.

use super::parse;
use crate::context::Context;
use crate::objects::checksum::is_sha256;
use prost::Message;
use std::collections::HashSet;
use yoto_proto::checks::scene::MAX_PICTURES;
use yoto_proto::limits::RESULT_BYTES;
use yoto_proto::names::{self, Collection};
use yoto_proto::render_needs::other_models;
use yoto_proto::v1::{
    EvaluateResult, EvaluateSpec, ExportResult, ExportSpec, ExportedFile, IngestResult, JobResult,
    JobSpec, ObjectRef, RenderResult, RenderSpec, RenderedFile, Scores, job_result, job_spec,
};
use yoto_proto::{keys, tiers};
use yoto_request::RequestError;
use yoto_store::{LeaseKey, Tenant};

/// Largest stored trade-off, bytes: it must fit into one message.
const MAX_TRADEOFF_BYTES: u64 = 1 << 20;

/// Checks that the result is one of this job and lease.
pub(crate) async fn check_result(
    context: &Context,
    tenant: &Tenant,
    lease: &LeaseKey,
    spec: &JobSpec,
    result: &JobResult,
) -> Result<(), RequestError> {
    check_length(result)?;
    match (&spec.kind, &result.kind) {
        (Some(job_spec::Kind::Ingest(spec)), Some(job_result::Kind::Ingest(result))) => {
            check_ingest(context, lease, &spec.capture, result).await
        }
        // All checkpoints may be damaged, or written anew by an earlier lease.
        (Some(job_spec::Kind::Train(spec)), Some(job_result::Kind::Train(result)))
            if !spec.leave.is_empty() && result.checkpoint.is_empty() =>
        {
            Ok(())
        }
        (Some(job_spec::Kind::Train(spec)), Some(job_result::Kind::Train(result))) => {
            let field = "result.train.checkpoint";
            check_checkpoint(context, tenant, &spec.model, field, &result.checkpoint).await
        }
        (Some(job_spec::Kind::Render(spec)), Some(job_result::Kind::Render(result))) => {
            check_render(context, tenant, lease, spec, result).await
        }
        (Some(job_spec::Kind::Evaluate(spec)), Some(job_result::Kind::Evaluate(result))) => {
            check_evaluate(context, tenant, spec, result).await?;
            check_tradeoff(context, lease, spec, result).await
        }
        (Some(job_spec::Kind::Export(spec)), Some(job_result::Kind::Export(result))) => {
            check_export(context, tenant, lease, spec, result).await
        }
        _ => Err(RequestError::invalid("result", "is not of the job's kind")),
    }
}

/// Checks the length of the result without the files of a render, because each watcher and each list of jobs gets it.
fn check_length(result: &JobResult) -> Result<(), RequestError> {
    let files: usize = match &result.kind {
        Some(job_result::Kind::Render(render)) => {
            render.files.iter().map(Message::encoded_len).sum()
        }
        _ => 0,
    };
    let bytes = result.encoded_len() - files;
    if bytes > RESULT_BYTES {
        let message = format!("{bytes} bytes beside files: at most {RESULT_BYTES} are allowed");
        return Err(RequestError::invalid("result", message));
    }
    Ok(())
}

async fn check_ingest(
    context: &Context,
    lease: &LeaseKey,
    capture: &str,
    result: &IngestResult,
) -> Result<(), RequestError> {
    let capture_id = parse(Collection::Captures, "job", capture)?;
    let expected = keys::shard(capture_id, &lease.job_id, lease.token);
    require(
        context,
        "result.ingest.shard",
        result.shard.as_ref(),
        |key| key == expected,
    )
    .await?;
    for (field, file, object) in [
        ("result.ingest.check", keys::CHECK, &result.check),
        (
            "result.ingest.thumbnail",
            keys::THUMBNAIL,
            &result.thumbnail,
        ),
    ] {
        let expected = keys::of_capture(capture_id, &lease.job_id, lease.token, file);
        if object.is_some() {
            let is_expected = |key: &str| key == expected;
            require(context, field, object.as_ref(), is_expected).await?;
        }
    }
    if result.frames == 0 || result.width == 0 || result.height == 0 {
        return Err(RequestError::invalid(
            "result.ingest",
            "a READY capture has frames",
        ));
    }
    Ok(())
}

/// Checks that the result names a checkpoint of the model.
async fn check_checkpoint(
    context: &Context,
    tenant: &Tenant,
    model: &str,
    field: &str,
    name: &str,
) -> Result<(), RequestError> {
    let model_id = parse(Collection::Models, "job", model)?;
    let checkpoints = context
        .store
        .checkpoints(tenant, model_id, u32::MAX)
        .await?;
    if checkpoints.iter().any(|checkpoint| checkpoint.name == name) {
        return Ok(());
    }
    let message = format!("'{name}' was not published");
    Err(RequestError::invalid(field, message))
}

/// Checks that the figures are finite and cover all requested subjects.
async fn check_evaluate(
    context: &Context,
    tenant: &Tenant,
    spec: &EvaluateSpec,
    result: &EvaluateResult,
) -> Result<(), RequestError> {
    let field = "result.evaluate.checkpoint";
    check_checkpoint(context, tenant, &spec.model, field, &result.checkpoint).await?;
    let measured = |subject: &String| result.subjects.iter().any(|it| it.subject == *subject);
    if result.subjects.is_empty() || !spec.subjects.iter().all(measured) {
        let message = "lacks figures of a requested subject";
        return Err(RequestError::invalid("result.evaluate.subjects", message));
    }
    for (i, subject) in result.subjects.iter().enumerate() {
        let field = format!("result.evaluate.subjects[{i}].scores");
        check_scores(&field, subject.scores.as_ref())?;
    }
    check_scores("result.evaluate.mean", result.mean.as_ref())
}

/// Checks that there is a trade-off of the measured checkpoint if and only if the order asked for one.
async fn check_tradeoff(
    context: &Context,
    lease: &LeaseKey,
    spec: &EvaluateSpec,
    result: &EvaluateResult,
) -> Result<(), RequestError> {
    let field = "result.evaluate.tradeoff";
    if spec.tradeoff.is_none() {
        return match result.tradeoff {
            Some(_) => Err(RequestError::invalid(field, "was not requested")),
            None => Ok(()),
        };
    }
    let (model_id, step) = names::parse_checkpoint(&result.checkpoint)
        .map_err(|error| RequestError::invalid("result.evaluate.checkpoint", error.to_string()))?;
    let expected = keys::tradeoff(model_id, &lease.job_id, lease.token, step);
    let object = result.tradeoff.as_ref();
    require(context, field, object, |key| key == expected).await?;
    match object {
        Some(object) if object.bytes > MAX_TRADEOFF_BYTES => {
            let message = format!(
                "{} bytes; at most {MAX_TRADEOFF_BYTES} are allowed",
                object.bytes
            );
            Err(RequestError::invalid(format!("{field}.bytes"), message))
        }
        _ => Ok(()),
    }
}

fn check_scores(field: &str, scores: Option<&Scores>) -> Result<(), RequestError> {
    let Some(scores) = scores else {
        return Err(RequestError::invalid(field, "is missing"));
    };
    let figures = [
        scores.psnr,
        scores.psnr_mask_box,
        scores.ssim,
        scores.ssim_uniform,
        scores.ssim_inflated,
        scores.lpips.unwrap_or_default(),
        scores.black_psnr,
    ];
    if scores.pictures == 0 || figures.iter().any(|figure| !figure.is_finite()) {
        let message = "holds no pictures, or figures that are not finite";
        return Err(RequestError::invalid(field, message));
    }
    Ok(())
}

async fn check_render(
    context: &Context,
    tenant: &Tenant,
    lease: &LeaseKey,
    spec: &RenderSpec,
    result: &RenderResult,
) -> Result<(), RequestError> {
    // A render of splats in real time may report a choice of settings, but does not have to.
    let may = spec.quality.is_some();
    let must = spec.quality.as_ref().is_some_and(tiers::needs_tradeoff);
    if (result.choice.is_some() && !may) || (result.choice.is_none() && must) {
        let message = "is present if and only if the spec had a quality that is measured";
        return Err(RequestError::invalid("result.render.choice", message));
    }
    check_others(spec, result)?;
    let count = result.files.len();
    if count > MAX_PICTURES as usize {
        let message = format!("{count} files: at most {MAX_PICTURES} are allowed");
        return Err(RequestError::invalid("result.render.files", message));
    }
    let committed = context.store.outputs(tenant, &lease.job_id).await?;
    let committed: HashSet<&RenderedFile> = committed.iter().collect();
    for (i, file) in result.files.iter().enumerate() {
        // Files of earlier leases were checked when they were committed.
        if committed.contains(file) {
            continue;
        }
        let expected = keys::render(&lease.job_id, lease.token, &file.file);
        let field = format!("result.render.files[{i}].object");
        require(context, &field, file.object.as_ref(), |key| key == expected).await?;
    }
    Ok(())
}

/// Checks that the result has a checkpoint for each other model of a scene. An older worker, which knows one
/// model per scene, would draw all people with that model.
fn check_others(spec: &RenderSpec, result: &RenderResult) -> Result<(), RequestError> {
    let used = result.other_checkpoints.iter();
    let used = used.map(|name| names::parse_checkpoint(name).ok().map(|(id, _)| id));
    let wanted = other_models(spec).into_iter();
    let wanted = wanted.map(|(_, name)| Collection::Models.parse(name).ok());
    if wanted.eq(used) {
        return Ok(());
    }
    let message =
        "are not of the scene's other models: does the worker know scenes of several models?";
    Err(RequestError::invalid(
        "result.render.other_checkpoints",
        message,
    ))
}

/// Checks that the files have the extensions of the form, and that the figures are finite.
async fn check_export(
    context: &Context,
    tenant: &Tenant,
    lease: &LeaseKey,
    spec: &ExportSpec,
    result: &ExportResult,
) -> Result<(), RequestError> {
    let field = "result.export.checkpoint";
    check_checkpoint(context, tenant, &spec.model, field, &result.checkpoint).await?;
    let extensions = spec.form().extensions();
    let has = |it: &ExportedFile, extension: &str| {
        it.file.rsplit_once('.').map(|(_, end)| end) == Some(extension)
    };
    let complete = result.files.len() == extensions.len()
        && result
            .files
            .iter()
            .zip(extensions)
            .all(|(it, end)| has(it, end));
    if !complete {
        let message = format!("are not one each of .{}", extensions.join(", ."));
        return Err(RequestError::invalid("result.export.files", message));
    }
    for (i, file) in result.files.iter().enumerate() {
        let expected = keys::render(&lease.job_id, lease.token, &file.file);
        let field = format!("result.export.files[{i}].object");
        require(context, &field, file.object.as_ref(), |key| key == expected).await?;
    }
    let distilled = result.distilled.as_ref();
    let figures = distilled.map(|it| [Some(it.seconds), it.psnr, it.psnr_mask_box]);
    let figures = figures.into_iter().flatten().flatten();
    for figure in figures {
        if !figure.is_finite() {
            let message = "holds figures that are not finite";
            return Err(RequestError::invalid("result.export.distilled", message));
        }
    }
    Ok(())
}

/// Checks that the object is named, may be written under this lease, and exists.
pub(crate) async fn require(
    context: &Context,
    field: &str,
    object: Option<&ObjectRef>,
    allowed: impl Fn(&str) -> bool,
) -> Result<(), RequestError> {
    let Some(object) = object else {
        return Err(RequestError::invalid(field, "is missing"));
    };
    if !allowed(&object.key) {
        let message = format!("'{}' is not a key of this job under this token", object.key);
        return Err(RequestError::invalid(format!("{field}.key"), message));
    }
    if !is_sha256(&object.sha256) {
        return Err(RequestError::invalid(
            format!("{field}.sha256"),
            "is not a SHA-256",
        ));
    }
    context.objects.require(object).await.map_err(|error| {
        if error.is_torn() {
            RequestError::invalid(field, error.to_string())
        } else {
            error.into()
        }
    })
}
