//! Manifests of checkpoints. A worker writes them, so what they name is checked: otherwise a checkpoint could name objects of
//! anybody, or none that exist, and take the place of a good one.

use crate::context::Context;
use futures::{StreamExt, TryStreamExt};
use std::collections::{BTreeMap, HashMap};
use std::time::Duration;
use yoto_objects::ObjectsError;
use yoto_proto::keys;
use yoto_proto::manifest::{Manifest, ManifestObject};
use yoto_proto::v1::{ErrorReason, ObjectRef};
use yoto_request::RequestError;

/// Longest manifest, bytes: some 10,000 people with two files each.
const LONGEST: u64 = 8 << 20;
/// Most bytes of a checkpoint whose content is compared when it is published: at the rate of one core, a fraction of a second. The
/// smallest objects come first.
const COMPARED: u64 = 256 << 20;
/// Objects that are compared at the same time.
const AT_ONCE: usize = 8;
/// Longest time that this takes. A worker waits 10 seconds for the answer, and asks again.
const PATIENCE: Duration = Duration::from_secs(4);
/// The field of a published checkpoint.
const FIELD: &str = "checkpoint.manifest";

/// Reads the manifest of a checkpoint, whose data objects are all in its own folder.
///
/// # Errors
/// [`ErrorReason::CheckpointTorn`] if it is no such manifest; an error of the store.
pub(crate) async fn read(context: &Context, object: &ObjectRef) -> Result<Manifest, RequestError> {
    let torn = |message| RequestError::precondition(ErrorReason::CheckpointTorn, message);
    if object.bytes > LONGEST {
        return Err(torn(format!("the manifest has more than {LONGEST} bytes")));
    }
    let bytes = context.objects.read(object).await?;
    let manifest =
        Manifest::from_json(&bytes).map_err(|error| torn(format!("the manifest: {error}")))?;
    let folder = keys::folder(&object.key);
    let foreign = |key: &str| keys::folder(key) != folder;
    match manifest.objects.iter().find(|it| foreign(&it.key)) {
        Some(object) => {
            let message = format!(
                "the manifest names '{}', which is not in {folder}",
                object.key
            );
            Err(torn(message))
        }
        None => Ok(manifest),
    }
}

/// Makes sure that a checkpoint that is to be published is whole: its manifest names objects of its folder, and all of them
/// are there in their sizes. Their content is compared with its SHA-256, as far as [`COMPARED`] and [`PATIENCE`] go, so that a damaged
/// checkpoint does not become the one that is used; each reader compares all.
///
/// # Errors
/// When it is not, naming the field; an error of the store.
pub(crate) async fn check(context: &Context, object: &ObjectRef) -> Result<(), RequestError> {
    let manifest = match read(context, object).await {
        Ok(manifest) => manifest,
        Err(RequestError::Precondition { message, .. }) => {
            return Err(RequestError::invalid(FIELD, message));
        }
        Err(error) => return Err(error),
    };
    if manifest.objects.is_empty() {
        return Err(RequestError::invalid(FIELD, "names no objects"));
    }
    let listed = context.objects.list(keys::folder(&object.key));
    let found: HashMap<String, u64> = listed.map_ok(|it| (it.key, it.bytes)).try_collect().await?;
    for object in &manifest.objects {
        let told = match found.get(&object.key) {
            Some(bytes) if *bytes == object.bytes => continue,
            Some(bytes) => format!("has {bytes} bytes, not {}", object.bytes),
            None => "does not exist".to_owned(),
        };
        let message = format!("names {}, which {told}", object.key);
        return Err(RequestError::invalid(FIELD, message));
    }
    match tokio::time::timeout(PATIENCE, compare(context, &manifest)).await {
        Ok(compared) => compared,
        Err(_) => {
            tracing::info!(
                manifest = object.key,
                "a checkpoint was published before all of its content was compared"
            );
            Ok(())
        }
    }
}

/// Compares the content of the objects with their SHA-256, up to [`COMPARED`] bytes. Larger ones are passed over.
async fn compare(context: &Context, manifest: &Manifest) -> Result<(), RequestError> {
    let mut left = COMPARED;
    let mut fits = |bytes: u64| match left.checked_sub(bytes) {
        Some(rest) => {
            left = rest;
            true
        }
        None => false,
    };
    let objects = manifest.objects.iter();
    let objects: BTreeMap<&str, &ManifestObject> = objects.map(|it| (&*it.key, it)).collect();
    let mut objects: Vec<&ManifestObject> = objects.into_values().collect();
    objects.sort_by_key(|it| it.bytes);
    let chosen: Vec<ObjectRef> = (objects.into_iter())
        .filter(|it| fits(it.bytes))
        .map(|it| ObjectRef {
            key: it.key.clone(),
            bytes: it.bytes,
            sha256: it.sha256.clone(),
        })
        .collect();
    let verified = futures::stream::iter(chosen)
        .map(|object| async move { context.objects.verify(&object).await })
        .buffer_unordered(AT_ONCE);
    let verified: Result<(), ObjectsError> = verified.try_collect().await;
    verified.map_err(|error| match error.is_torn() {
        true => RequestError::invalid(FIELD, error.to_string()),
        false => error.into(),
    })
}
