//! Reads the objects that rows name, and those that manifests name.

use super::{ObjectFault, Progress};
use futures::{StreamExt, TryStreamExt, stream};
use std::collections::{BTreeMap, HashSet};
use yoto_objects::{Objects, ObjectsError};
use yoto_proto::keys;
use yoto_proto::manifest::Manifest;
use yoto_proto::v1::ObjectRef;
use yoto_store::NamedObject;

/// Objects that are read at the same time.
const AT_ONCE: usize = 8;

/// What was read.
#[derive(Debug, Default)]
pub(super) struct Verification<'a> {
    /// Keys of all objects that rows and manifests name.
    pub keys: HashSet<String>,
    /// Their bytes.
    pub bytes: u64,
    /// What is wrong.
    pub faults: Vec<Faulty<'a>>,
    /// Folders of manifests that can't be read: nobody knows which objects in them are named.
    pub unknown: HashSet<String>,
}

/// A faulty object.
#[derive(Debug)]
pub(super) struct Faulty<'a> {
    /// The row's object: itself, or the manifest that names it.
    pub by: &'a NamedObject,
    /// Whether the store does not have it.
    pub is_missing: bool,
    /// Key and words.
    pub fault: ObjectFault,
}

/// An object to read, and the row's object from which it is known.
#[derive(Debug, Clone)]
struct ObjectToRead<'a> {
    by: &'a NamedObject,
    object: ObjectRef,
}

/// Reads the objects of `named`, and what the manifests among them name.
pub(super) async fn all<'a>(
    objects: &Objects,
    named: &'a [NamedObject],
    mut progress: impl FnMut(Progress),
) -> Result<Verification<'a>, ObjectsError> {
    let mut found = Verification::default();
    let (manifests, others): (Vec<_>, Vec<_>) = named.iter().partition(|it| it.manifest);
    let mut wanted: Vec<ObjectToRead<'_>> = (others.into_iter())
        .map(|by| ObjectToRead {
            by,
            object: by.object.clone(),
        })
        .collect();
    let reads = stream::iter(manifests.into_iter().map(|by| async move {
        let read = manifest(objects, &by.object).await?;
        Ok::<_, ObjectsError>((by, read))
    }));
    let mut reads = reads.buffer_unordered(AT_ONCE);
    while let Some((by, read)) = reads.try_next().await? {
        let object = &by.object;
        found.count(object);
        match read {
            Ok(its) => wanted.extend(its.objects.into_iter().map(|it| ObjectToRead {
                by,
                object: ObjectRef {
                    key: it.key,
                    bytes: it.bytes,
                    sha256: it.sha256,
                },
            })),
            Err(why) => {
                found.unknown.insert(keys::folder(&object.key).to_owned());
                found.faults.push(why.of(by, object));
            }
        }
    }
    // The row of a job and its result name the same object.
    let mut once = BTreeMap::new();
    for it in wanted {
        found.count(&it.object);
        let reference = (
            it.object.key.clone(),
            it.object.bytes,
            it.object.sha256.clone(),
        );
        once.entry(reference).or_insert(it);
    }
    let of = once.values().map(|it| it.object.bytes).sum();
    let mut bytes = 0;
    let reads = stream::iter(once.into_values().map(|it| async move {
        let fault = fault(objects, &it.object).await?;
        Ok::<_, ObjectsError>((it, fault))
    }));
    let mut reads = reads.buffer_unordered(AT_ONCE);
    while let Some((it, fault)) = reads.try_next().await? {
        bytes += it.object.bytes;
        progress(Progress { bytes, of });
        found
            .faults
            .extend(fault.map(|fault| fault.of(it.by, &it.object)));
    }
    found
        .faults
        .sort_by(|a, b| (&a.fault.of, &a.fault.key).cmp(&(&b.fault.of, &b.fault.key)));
    Ok(found)
}

impl Verification<'_> {
    fn count(&mut self, object: &ObjectRef) {
        if self.keys.insert(object.key.clone()) {
            self.bytes += object.bytes;
        }
    }
}

/// Why an object is faulty.
struct Why {
    is_missing: bool,
    what: String,
}

impl Why {
    /// The fault of an object; an error if it says nothing about the object.
    fn read(error: ObjectsError) -> Result<Self, ObjectsError> {
        match error {
            ObjectsError::Missing { .. } => Ok(Self {
                is_missing: true,
                what: "it is missing".to_owned(),
            }),
            ObjectsError::Size {
                expected, found, ..
            } => Ok(Self::damaged(format!(
                "it has {found} bytes, not {expected}"
            ))),
            error if error.is_torn() => Ok(Self::damaged(
                "its bytes are not those of its checksum".to_owned(),
            )),
            error => Err(error),
        }
    }

    fn damaged(what: String) -> Self {
        Self {
            is_missing: false,
            what,
        }
    }

    fn of<'a>(self, by: &'a NamedObject, object: &ObjectRef) -> Faulty<'a> {
        Faulty {
            by,
            is_missing: self.is_missing,
            fault: ObjectFault {
                key: object.key.clone(),
                of: by.of.clone(),
                what: self.what,
            },
        }
    }
}

/// The manifest, or what is wrong with it.
async fn manifest(
    objects: &Objects,
    object: &ObjectRef,
) -> Result<Result<Manifest, Why>, ObjectsError> {
    match objects.read(object).await {
        Ok(bytes) => Ok(Manifest::from_json(&bytes)
            .map_err(|error| Why::damaged(format!("it is no manifest: {error}")))),
        Err(error) => Why::read(error).map(Err),
    }
}

/// What is wrong with an object.
async fn fault(objects: &Objects, object: &ObjectRef) -> Result<Option<Why>, ObjectsError> {
    if object.sha256.is_empty() {
        return shorter(objects, object).await;
    }
    match objects.verify(object).await {
        Ok(()) => Ok(None),
        Err(error) => Why::read(error).map(Some),
    }
}

/// Whether an object without a checksum has fewer bytes than its row says.
async fn shorter(objects: &Objects, object: &ObjectRef) -> Result<Option<Why>, ObjectsError> {
    let ObjectRef { key, bytes, .. } = object;
    let found = match objects.size(key).await {
        Ok(Some(found)) if found >= *bytes => return Ok(None),
        Ok(Some(found)) => ObjectsError::Size {
            key: key.clone(),
            expected: *bytes,
            found,
        },
        Ok(None) => ObjectsError::Missing { key: key.clone() },
        Err(error) => error,
    };
    Why::read(found).map(Some)
}
