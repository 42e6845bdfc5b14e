//! Manifests of checkpoints. A worker writes them, so what they name is checked: otherwise a checkpoint could name objects of
//! anybody, or none that exist, and take the place of a good one.

use crate::context::Context;
use futures::TryStreamExt;
use std::collections::HashMap;
use yoto_proto::keys;
use yoto_proto::manifest::Manifest;
use yoto_proto::v1::{ErrorReason, ObjectRef};
use yoto_request::RequestError;

/// Longest manifest, bytes: some 10,000 people with two files each.
const LONGEST: u64 = 8 << 20;
/// Most bytes of a checkpoint whose content is compared when it is published: at the rate of one core, a fraction of a second. Of a larger
/// one, the first objects with as many bytes.
const COMPARED: u64 = 256 << 20;
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
/// are there in their sizes. Their content is compared with its SHA-256 up to [`COMPARED`] bytes, so that a damaged checkpoint
/// does not become the one that is used; each reader compares all.
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
    let mut left = COMPARED;
    for object in &manifest.objects {
        let Some(rest) = left.checked_sub(object.bytes) else {
            break;
        };
        left = rest;
        let object = ObjectRef {
            key: object.key.clone(),
            bytes: object.bytes,
            sha256: object.sha256.clone(),
        };
        (context.objects.verify(&object).await).map_err(|error| match error.is_torn() {
            true => RequestError::invalid(FIELD, error.to_string()),
            false => error.into(),
        })?;
    }
    Ok(())
}
