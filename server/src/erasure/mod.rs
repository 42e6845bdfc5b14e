//! Removes a person from everything: jobs, models, rows, objects; then searches for what is left.
//!
//! The steps are in rows, so that any coordinator goes on with them, also after a restart: consents are revoked and open jobs end,
//! a job of each model writes its checkpoints anew, others are trained anew where that was asked for, rows go in one transaction, folders of the store after it, and the report comes
//! last. Each step may be repeated.

mod report;
mod sign;

use crate::context::Context;
use crate::jobs::consent;
use futures::TryStreamExt;
use report::{Report, Search};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use tokio::time::{MissedTickBehavior, interval};
use yoto_objects::Listed;
use yoto_proto::keys;
use yoto_proto::names::Collection;
use yoto_proto::v1::ErrorReason;
use yoto_request::RequestError;
use yoto_store::{Counted, JobKind, Leaving, OpenErasure, Reference, StoreError, Work};

/// Goes on with erasures until the coordinator stops.
pub(crate) async fn run(context: Arc<Context>) {
    let mut ticks = interval(context.config.reap_interval);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            () = context.stop.cancelled() => return,
            _ = ticks.tick() => tick(&context).await,
        }
    }
}

/// Goes on with all open erasures. A failure is logged, and the step is tried again.
pub(crate) async fn tick(context: &Context) {
    let open = match context.store.open_erasures().await {
        Ok(open) => open,
        Err(error) => return tracing::error!(%error, "could not look for erasures"),
    };
    if open.is_empty() {
        return;
    }
    // Another step of this process would find the same.
    let Ok(_one_at_a_time) = context.alone.erasing.try_lock() else {
        return;
    };
    for erasure in open {
        let Err(error) = advance(context, &erasure).await else {
            continue;
        };
        match error {
            // Such as a drain.
            RequestError::Store(StoreError::Rule { message, .. }) => {
                let noted = context.store.note_erasure(&erasure.id, &message).await;
                if let Err(error) = noted {
                    tracing::error!(erasure = erasure.id, %error, "an erasure waits");
                }
            }
            error => {
                tracing::error!(erasure = erasure.id, %error, "an erasure waits: its step is tried again");
            }
        }
    }
}

/// Does what can be done now.
async fn advance(context: &Context, erasure: &OpenErasure) -> Result<(), RequestError> {
    let work = match &erasure.work {
        Some(work) => Work::of_json(work)?,
        None => {
            stop_jobs(context, erasure).await?;
            if !leave_models(context, erasure).await? {
                return Ok(());
            }
            if erasure.retrain {
                for model in context.store.retrain(erasure).await? {
                    context.notifier.queued(&erasure.tenant, JobKind::Train);
                    tracing::info!(erasure = erasure.id, model, "others are trained anew");
                }
            }
            match context.store.erase_rows(erasure).await? {
                Some(work) => work,
                None => return Ok(()),
            }
        }
    };
    finish(context, erasure, work).await
}

/// Ends all open jobs that need the person.
async fn stop_jobs(context: &Context, erasure: &OpenErasure) -> Result<(), RequestError> {
    consent::stop(context, Some(&erasure.subject_id)).await?;
    for job in context.store.stop_ingests(&erasure.subject_id).await? {
        context.notifier.announce_end(&Collection::Jobs.name(&job));
    }
    Ok(())
}

/// Takes the person out of their models. Returns whether that is done.
async fn leave_models(context: &Context, erasure: &OpenErasure) -> Result<bool, RequestError> {
    let mut waits = Vec::new();
    for (model, leaving) in context.store.leave_models(erasure).await? {
        match leaving {
            Leaving::Done => {}
            Leaving::Queued { job } => {
                context.notifier.queued(&erasure.tenant, JobKind::Train);
                tracing::info!(erasure = erasure.id, job, model, "a person leaves a model");
                waits.push(job);
            }
            Leaving::Waits { job } => waits.push(job),
            Leaving::Failed { job, why } => {
                let message = format!(
                    "{job}, which takes the person out of models/{model}, has failed: {why}"
                );
                tracing::error!(erasure = erasure.id, message, "an erasure has failed");
                context.store.fail_erasure(&erasure.id, &message).await?;
                return Ok(false);
            }
        }
    }
    if waits.is_empty() {
        return Ok(true);
    }
    let message = format!(
        "waits for {}, which writes checkpoints anew",
        waits.join(", ")
    );
    context.store.note_erasure(&erasure.id, &message).await?;
    Ok(false)
}

/// Removes the objects, searches, and reports.
async fn finish(
    context: &Context,
    erasure: &OpenErasure,
    mut work: Work,
) -> Result<(), RequestError> {
    // A collection notes folders that it has still seen. While one runs, this waits for a later attempt.
    let Ok(_alone) = context.alone.collecting.try_lock() else {
        return Ok(());
    };
    if work.objects.is_none() {
        add_unnamed(context, &mut work).await?;
        work.objects = Some(counted(context, &work.folders).await?);
        context
            .store
            .note_work(&erasure.id, &work.to_json()?)
            .await?;
    }
    for folder in &work.folders {
        context.storage.place.delete_folder(folder).await?;
    }
    // No row that could be written to them is left. Notes of checkpoints stay: their keys have nothing of the person.
    let noted = work.folders.iter().filter(|it| !it.starts_with("models/"));
    let noted: Vec<String> = noted.cloned().collect();
    context.store.forget_garbage(&noted).await?;
    let left = counted(context, &work.folders).await?;
    let ids = context.store.traces_of_ids(&work.ids).await?;
    let names = context.store.traces_of_name(&work.name).await?;
    let shown = context.store.erasure(&erasure.tenant, &erasure.id).await?;
    let search = Search {
        folders: work.folders.len(),
        objects_left: left.values().map(|it| it.objects).sum(),
        ids_left: &ids,
        names_left: &names,
    };
    let objects = work.objects.clone().unwrap_or_default();
    let named = (&*shown.name, &*shown.subject, &*shown.name_sha256);
    let json = Report::new(named, &work, &objects, search).to_json()?;
    let signed = sign::sign(&context.config.data_dir, json);
    let signed = signed.map_err(|error| {
        let message = format!("the key of erasures: {error}");
        RequestError::precondition(ErrorReason::Internal, message)
    })?;
    context.store.end_erasure(&erasure.id, &signed).await?;
    tracing::info!(
        erasure = erasure.id,
        subject = erasure.subject_id,
        "a person was erased"
    );
    Ok(())
}

/// Adds the folders of models that nothing names: checkpoints that were replaced or deleted, also before this erasure.
async fn add_unnamed(context: &Context, work: &mut Work) -> Result<(), RequestError> {
    let mut found = BTreeSet::new();
    for model in &work.unnamed {
        let listed: Vec<Listed> = context.objects.list(model).try_collect().await?;
        let folders = listed
            .iter()
            .filter_map(|it| keys::collected_folder(&it.key));
        found.extend(folders.map(str::to_owned));
    }
    let found: Vec<String> = found.into_iter().collect();
    let keep = context.config.storage.keep_uploads.as_secs_f64();
    let references = context.store.references(&found, keep).await?;
    for (folder, reference) in found.into_iter().zip(references) {
        if matches!(reference, Reference::Nothing) {
            work.folders.push(folder);
        }
    }
    Ok(())
}

/// Objects and bytes in these folders, by the first folder of their keys.
async fn counted(
    context: &Context,
    folders: &[String],
) -> Result<BTreeMap<String, Counted>, RequestError> {
    let mut found: BTreeMap<String, Counted> = BTreeMap::new();
    for folder in folders {
        let listed: Vec<Listed> = context.objects.list(folder).try_collect().await?;
        let root = folder.split('/').next().unwrap_or_default();
        for object in listed {
            let counted = found.entry(root.to_owned()).or_default();
            counted.objects += 1;
            counted.bytes += object.bytes;
        }
    }
    Ok(found)
}
