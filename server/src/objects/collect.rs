//! Garbage collection: folders of the object store that nothing refers to.
//!
//! A folder is kept while a row names its objects, or a job runs under its token. Any other folder is noted,
//! and removed after a time of grace. During that time an operator can still restore deleted objects by hand,
//! and open reads can finish.

use super::folders::Folder;
use crate::context::Context;
use futures::future::BoxFuture;
use futures::{FutureExt, StreamExt, TryStreamExt, stream};
use std::collections::{HashMap, HashSet};
use std::sync::Arc;
use tokio::time::{MissedTickBehavior, interval};
use yoto_objects::Listed;
use yoto_process::metrics::METRICS;
use yoto_proto::keys::{self, FolderOwner};
use yoto_request::RequestError;
use yoto_store::{Horizons, KnownGarbage, PartId, Reference};

/// Folders that are searched or removed at once: a remote store answers each of its requests after some 50 ms.
const CONCURRENCY: usize = 8;

/// How to collect.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Options {
    /// Change nothing.
    pub dry_run: bool,
    /// Do not wait for the time of grace for objects of deleted resources.
    pub now: bool,
}

/// A folder that is garbage.
#[derive(Debug, Clone)]
pub(crate) struct Garbage {
    /// The folder.
    pub folder: Folder,
    /// Whether it belonged to a deleted resource.
    pub deleted: bool,
    /// Seconds since it was found.
    pub age: f64,
    /// Whether it was removed, or would be without `dry_run`.
    pub due: bool,
}

/// Collects at once and then at each interval, until the coordinator stops.
pub(crate) async fn run(context: Arc<Context>) {
    let mut ticks = interval(context.config.storage.collect_interval);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            () = context.stop.cancelled() => return,
            _ = ticks.tick() => {}
        }
        if let Err(error) = collect(&context, Options::default()).await {
            tracing::error!(%error, "could not collect garbage");
        }
        let limits = &context.config.storage;
        let horizons = Horizons {
            request_ids: limits.keep_request_ids.as_secs_f64(),
            attempts: limits.keep_attempts.as_secs_f64(),
            workers: limits.keep_workers.as_secs_f64(),
            audit: limits.keep_audit.map(|it| it.as_secs_f64()),
        };
        match context.store.forget(horizons).await {
            Ok(0) => {}
            Ok(rows) => tracing::info!(
                rows,
                "old request ids, attempts, workers and entries of the audit log forgotten"
            ),
            Err(error) => tracing::error!(%error, "could not forget old rows"),
        }
    }
}

/// Finds all garbage, and removes what is due. A collection waits for another of the same process. Those of several
/// coordinators may run at once: they find the same folders, and what one has removed is gone for the other.
///
/// # Errors
/// When a store fails. A folder that can't be removed is logged, stays, and is not due in the answer.
pub(crate) async fn collect(
    context: &Context,
    options: Options,
) -> Result<Vec<Garbage>, RequestError> {
    let _one_at_a_time = context.alone.collecting.lock().await;
    if !options.dry_run {
        let idle = context.config.upload.expiry.as_secs_f64();
        for upload in context.store.expire_uploads(idle).await? {
            tracing::info!(upload, "an idle upload has ended by itself");
        }
    }
    // In this order: an object is written before a row names it, and noted before it is looked for.
    let known = context.store.garbage().await?;
    let folders = context.storage.place.folders().await?;
    let keys: Vec<String> = folders.iter().map(|it| it.key.clone()).collect();
    let references = context.store.references(&keys, kept(context)).await?;
    let grace = context.config.storage.grace.as_secs_f64();
    if !options.dry_run {
        let mut searches = Vec::new();
        for (folder, reference) in folders.iter().zip(&references) {
            if let (Reference::Row, Some(FolderOwner::Upload { capture })) =
                (reference, FolderOwner::parse(&folder.key))
            {
                searches.push(remove_orphans(context, capture).boxed());
            }
        }
        concurrently(searches).await?;
    }
    let mut found = judge(folders, &references, &known);
    for it in &mut found {
        it.due = it.age >= grace || (options.now && it.deleted);
    }
    if options.dry_run {
        return Ok(found);
    }
    let gone = forgotten(context, &known, &keys, &found).await?;
    let noted: HashSet<&str> = known.iter().map(|it| it.folder.as_str()).collect();
    let new = found.iter().map(|it| &it.folder.key);
    let new: Vec<String> = new
        .filter(|key| !noted.contains(key.as_str()))
        .cloned()
        .collect();
    if !new.is_empty() || !gone.is_empty() {
        context.store.note_garbage(&new, &gone).await?;
    }
    let due: Vec<usize> = (0..found.len()).filter(|at| found[*at].due).collect();
    // Several coordinators find the same: each begins somewhere else.
    let first = uuid::Uuid::new_v4().as_u128() % due.len().max(1) as u128;
    let (later, sooner) = due.split_at(first as usize);
    let mut removals = Vec::with_capacity(due.len());
    for at in sooner.iter().chain(later) {
        removals.push(remove(context, *at, &found[*at]).boxed());
    }
    for (at, is_gone) in concurrently(removals).await? {
        found[at].due = is_gone;
    }
    let removed = found.iter().filter(|it| it.due).map(|it| it.folder.bytes);
    METRICS.collected(removed.sum());
    Ok(found)
}

/// The results of `work`, in any order; after the first error, what waits is not begun.
async fn concurrently<T: Send>(
    work: Vec<BoxFuture<'_, Result<T, RequestError>>>,
) -> Result<Vec<T>, RequestError> {
    let running = stream::iter(work).buffer_unordered(CONCURRENCY);
    running.try_collect().await
}

/// Removes the folder of garbage number `at`, unless the coordinator stops. Returns the number, and whether it is gone.
async fn remove(context: &Context, at: usize, it: &Garbage) -> Result<(usize, bool), RequestError> {
    let Folder { key, bytes, .. } = &it.folder;
    if context.stop.is_cancelled() || !is_released(context, key).await? {
        return Ok((at, false));
    }
    let removed = context.storage.place.delete_folder(key).await;
    match &removed {
        Ok(()) => tracing::info!(key, bytes, deleted = it.deleted, "garbage removed"),
        Err(error) => {
            tracing::error!(error = error.with_causes(), "could not remove garbage");
        }
    }
    Ok((at, removed.is_ok()))
}

/// Removes the parts of an upload in use that no row names or will name: those of writers that lost the upload, or were
/// killed, between the object and its row, and those that were joined to the next part.
async fn remove_orphans(context: &Context, capture: &str) -> Result<(), RequestError> {
    let listed = context.objects.list(&keys::upload_parts(capture));
    let found: Vec<Listed> = listed.try_collect().await?;
    let parts = found.iter().filter_map(|it| keys::writer_of_part(&it.key));
    let parts: Vec<PartId> = parts
        .map(|(writer, number)| PartId { writer, number })
        .collect();
    let orphans = context.store.orphans_of_upload(capture, &parts).await?;
    for PartId { writer, number } in orphans {
        let key = keys::upload_part(capture, writer, number);
        context.objects.delete(&key).await?;
        tracing::info!(key, "a part of an upload that nothing names is removed");
    }
    Ok(())
}

/// Whether no row can name the folder `key` from now on. This was true of all folders when their references were read,
/// but the files of a rejected capture may be read again since then.
async fn is_released(context: &Context, key: &str) -> Result<bool, RequestError> {
    match FolderOwner::parse(key) {
        Some(FolderOwner::Upload { capture }) => {
            Ok(context.store.release_upload(capture, kept(context)).await?)
        }
        _ => Ok(true),
    }
}

/// Seconds for which uploads that were read are kept.
fn kept(context: &Context) -> f64 {
    context.config.storage.keep_uploads.as_secs_f64()
}

/// The garbage among `folders`, none of it due yet.
fn judge(folders: Vec<Folder>, references: &[Reference], known: &[KnownGarbage]) -> Vec<Garbage> {
    let known: HashMap<&str, &KnownGarbage> =
        known.iter().map(|it| (it.folder.as_str(), it)).collect();
    let judged = folders.into_iter().zip(references);
    let garbage = judged.filter_map(|(folder, reference)| {
        let deleted = deleted(&known, &folder.key);
        let found = known.get(folder.key.as_str()).or(deleted.as_ref());
        let age = found.map_or(0.0, |it| it.age);
        // A running training removes its own old checkpoints, so a lease does not keep what was deleted.
        let live = match reference {
            Reference::Row => true,
            Reference::Lease => deleted.is_none(),
            Reference::Nothing => false,
        };
        (!live).then_some(Garbage {
            deleted: deleted.is_some(),
            age,
            due: false,
            folder,
        })
    });
    garbage.collect()
}

/// The note that this folder, or a parent folder, was deleted.
fn deleted<'a>(known: &HashMap<&str, &'a KnownGarbage>, key: &str) -> Option<&'a KnownGarbage> {
    let mut at = key;
    while !at.is_empty() {
        if let Some(it) = known.get(at).filter(|it| it.deleted) {
            return Some(it);
        }
        at = keys::folder(at);
    }
    None
}

/// The notes to delete: of folders that do not exist, or are not garbage. The note of a checkpoint
/// stays while its training runs, so that a late call can't publish it again.
async fn forgotten(
    context: &Context,
    known: &[KnownGarbage],
    listed: &[String],
    found: &[Garbage],
) -> Result<Vec<String>, RequestError> {
    let garbage: HashSet<&str> = found.iter().map(|it| it.folder.key.as_str()).collect();
    let inside = |key: &str, folder: &str| {
        let rest = key.strip_prefix(folder);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
    };
    let there = |folder: &str| listed.iter().any(|key| inside(key, folder));
    let (deleted, others): (Vec<_>, Vec<_>) = known.iter().partition(|it| it.deleted);
    let others = others
        .into_iter()
        .filter(|it| !garbage.contains(it.folder.as_str()));
    let deleted = deleted.into_iter().filter(|it| !there(&it.folder));
    let deleted: Vec<String> = deleted.map(|it| it.folder.clone()).collect();
    let references = context.store.references(&deleted, kept(context)).await?;
    let deleted = deleted.into_iter().zip(references);
    let deleted = deleted.filter(|(_, reference)| *reference != Reference::Lease);
    let others = others.map(|it| it.folder.clone());
    Ok(others.chain(deleted.map(|(folder, _)| folder)).collect())
}
