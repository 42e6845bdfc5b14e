//! Input and output types of the store, besides the contract's messages.

use super::JobKind;
use crate::Tenant;
use prost::Message;
use std::collections::{HashMap, HashSet};
use yoto_objects::Part;
use yoto_proto::v1::{self, ConsentPurpose, ObjectRef, WorkerDevice};

/// What to change of a subject.
#[derive(Debug, Clone, Default)]
pub struct SubjectChange {
    /// Its new display name.
    pub display_name: Option<String>,
    /// Its new consent note.
    pub consent_note: Option<String>,
}

/// A new id: unique, and in the alphabet that resource names allow.
pub fn new_id() -> String {
    uuid::Uuid::new_v4().to_string()
}

/// Identifies a repeated call: the caller's id, and the request.
#[derive(Debug, Clone)]
pub struct RequestKey {
    /// The RPC; ids of different RPCs never collide.
    pub method: &'static str,
    /// The caller's id.
    pub request_id: String,
    /// SHA-256 of the encoded request.
    pub body_sha256: String,
}

impl RequestKey {
    /// The key of `body`, which has `request_id`; none without an id.
    pub fn new(method: &'static str, request_id: &str, body: &impl Message) -> Option<Self> {
        if request_id.is_empty() {
            return None;
        }
        let body_sha256 = yoto_proto::sha256_hex(&body.encode_to_vec());
        Some(Self {
            method,
            request_id: request_id.to_owned(),
            body_sha256,
        })
    }
}

/// A page of a list.
#[derive(Debug, Clone, Copy)]
pub struct Page {
    /// Largest number of entries.
    pub limit: u32,
    /// Continue after this position; none starts at the beginning.
    pub after: Option<i64>,
}

/// An entry of a list with its position, after which the next page starts.
#[derive(Debug, Clone)]
pub struct Entry<T> {
    /// Increases or decreases along the list.
    pub position: i64,
    /// The entry.
    pub item: T,
}

/// A subject to create.
#[derive(Debug, Clone)]
pub struct NewSubject {
    /// Human-readable.
    pub display_name: String,
    /// The consent under which the recordings are used.
    pub consent_note: String,
}

/// A consent to record.
#[derive(Debug, Clone, Default)]
pub struct NewConsent {
    /// What the person agrees to.
    pub purposes: Vec<ConsentPurpose>,
    /// Who gave it; empty: the person.
    pub given_by: String,
    /// Anything else.
    pub note: String,
    /// When it runs out, seconds since 1970; none: never.
    pub expire_time: Option<f64>,
    /// The file that proves it.
    pub evidence: Option<NewEvidence>,
}

/// An upload to open.
#[derive(Debug, Clone)]
pub struct NewUpload {
    /// Whose capture it is.
    pub subject_id: String,
    /// Its announced files.
    pub files: Vec<UploadedFile>,
}

/// An upload, which is a capture as long as its files are written.
#[derive(Debug, Clone)]
pub struct Upload {
    /// The id of its capture.
    pub id: String,
    /// Whose capture it is.
    pub subject_id: String,
    /// Whether it may still be written.
    pub open: bool,
    /// When it was last written, seconds since 1970 on the database's clock.
    pub write_time: f64,
    /// Its files, by path.
    pub files: Vec<UploadFile>,
    /// Its newest part.
    pub newest: Option<UploadPart>,
    /// Number of pieces of its files.
    pub pieces: u64,
}

/// A file of an upload.
#[derive(Debug, Clone)]
pub struct UploadFile {
    /// Relative to the capture.
    pub path: String,
    /// Size once it is complete.
    pub bytes: u64,
    /// Checksum once it is complete, lower-case hex.
    pub sha256: String,
    /// Committed bytes, from the beginning of the file.
    pub committed: u64,
}

/// A part of an upload: the writer that has committed it, and its number among that writer's commits. The parts in this
/// order have the bytes of each file in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PartId {
    /// Number of the writer; 0 for a file that an earlier version has stored.
    pub writer: u64,
    /// Number of the commit.
    pub number: u64,
}

/// A part of an upload, without its pieces.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UploadPart {
    /// Which one.
    pub id: PartId,
    /// Its object.
    pub object: ObjectRef,
}

/// A range of bytes of a file that follows its committed bytes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NewPiece {
    /// The file's path.
    pub path: String,
    /// First byte.
    pub from: u64,
    /// Byte after the last.
    pub to: u64,
}

/// A part of an upload that is in the object store and is to be recorded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NewPart {
    /// Which one.
    pub id: PartId,
    /// Its object: the bytes of the part that it replaces, then those of its pieces.
    pub object: ObjectRef,
    /// Its pieces, in their order.
    pub pieces: Vec<NewPiece>,
    /// The part that it replaces, the newest one.
    pub replaces: Option<PartId>,
}

/// A part of an upload with its pieces, whose files are called by their paths.
#[derive(Debug, Clone)]
pub struct StoredPart {
    /// Which one.
    pub id: PartId,
    /// Its object and pieces.
    pub part: Part<String>,
}

/// A model to create.
#[derive(Debug, Clone)]
pub struct NewModel {
    /// Human-readable.
    pub display_name: String,
    /// One of [`yoto_proto::tiers::TIERS`].
    pub tier: String,
    /// One of [`yoto_proto::tiers::VARIANTS`].
    pub variant: String,
    /// Which checkpoints it keeps.
    pub retention: v1::Retention,
}

/// Something to delete, by id.
#[derive(Debug, Clone, Copy)]
pub enum Target<'a> {
    /// A person, with their captures.
    Subject(&'a str),
    /// A capture.
    Capture(&'a str),
    /// A model, with its checkpoints and jobs.
    Model(&'a str),
    /// A checkpoint.
    Checkpoint {
        /// Its model.
        model: &'a str,
        /// Its step.
        step: u64,
    },
    /// A job that has ended.
    Job(&'a str),
}

/// A folder of the object store that was noted as garbage.
#[derive(Debug, Clone)]
pub struct KnownGarbage {
    /// Its key. If `deleted` is set, everything below it is garbage as well.
    pub folder: String,
    /// Whether it belonged to a deleted resource.
    pub deleted: bool,
    /// Seconds since it was found.
    pub age: f64,
}

/// What refers to a folder of the object store.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reference {
    /// A row of the catalogue: its objects are in use.
    Row,
    /// A running job that may write to it.
    Lease,
    /// Nothing, and no reference can appear any more.
    Nothing,
}

/// A worker that registers.
#[derive(Debug, Clone)]
pub struct NewWorker {
    /// Human-readable.
    pub display_name: String,
    /// Its device.
    pub device: WorkerDevice,
    /// Kinds of jobs that it runs.
    pub kinds: Vec<JobKind>,
    /// The coordinator in whose process it runs.
    pub embedded: Option<String>,
    /// Version of its program.
    pub version: String,
    /// The newest orders that it understands.
    pub order_level: u32,
    /// Whether it has a pose model.
    pub reads_films: bool,
    /// Id of the key with which it registers; none where no key is asked for.
    pub key: Option<String>,
}

/// A link that is made.
#[derive(Debug, Clone)]
pub struct NewShare {
    /// Id of the export whose page it shows.
    pub job_id: String,
    /// Id of the person.
    pub subject_id: String,
    /// SHA-256 of the link's secret, lower-case hex.
    pub sha256: String,
    /// For whom it is.
    pub note: String,
    /// Whether other sites may show the page.
    pub embed: bool,
    /// When it ends, seconds since 1970; none: never.
    pub expire_time: Option<f64>,
}

/// What a valid link shows.
#[derive(Debug, Clone)]
pub struct Shared {
    /// The tenant who made it.
    pub tenant: Tenant,
    /// Id of the export.
    pub job_id: String,
    /// Whether other sites may show the page.
    pub embed: bool,
}

/// Links that are listed.
#[derive(Debug, Clone, Default)]
pub struct ShareFilter {
    /// Id of the export; none: of all.
    pub job_id: Option<String>,
    /// Id of the person; none: of all.
    pub subject_id: Option<String>,
}

/// A file that proves a consent.
#[derive(Debug, Clone)]
pub struct NewEvidence {
    /// Its name.
    pub file_name: String,
    /// Its bytes.
    pub content: Vec<u8>,
}

/// A file that was uploaded and written to the object store.
#[derive(Debug, Clone)]
pub struct UploadedFile {
    /// Relative to the capture.
    pub path: String,
    /// Size.
    pub bytes: u64,
    /// Lower-case hex.
    pub sha256: String,
}

/// Ages at which rows are forgotten, seconds.
#[derive(Debug, Clone, Copy)]
pub struct Horizons {
    /// Answers to request ids.
    pub request_ids: f64,
    /// Ended attempts of jobs.
    pub attempts: f64,
    /// Workers that no row names any more.
    pub workers: f64,
    /// Entries of the audit log; without one, they stay.
    pub audit: Option<f64>,
}

/// Why an operator keeps jobs from being taken, and who it is.
#[derive(Debug, Clone, Copy, Default)]
pub struct OperatorNote<'a> {
    /// For people.
    pub reason: &'a str,
    /// Id of the operator's key; empty where none is asked for.
    pub key: &'a str,
}

/// Everything that rows name in the object store, and what may get a row yet.
#[derive(Debug, Default)]
pub struct References {
    /// The objects, each once for each resource that names it.
    pub objects: Vec<NamedObject>,
    /// Leases that last, as job and token: what is written under one may get a row.
    pub leases: HashSet<(String, u64)>,
    /// Open uploads with their newest writers, whose parts may get rows.
    pub writers: HashMap<String, u64>,
}

/// An object that a row names.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct NamedObject {
    /// The resource of the row, e.g. `jobs/{id}`.
    pub of: String,
    /// Key, size and checksum. The checksum is empty for a part of an upload by an earlier version, whose size is the
    /// least that the object has.
    pub object: ObjectRef,
    /// Whether it is the manifest of a checkpoint, which names other objects.
    pub manifest: bool,
}

impl References {
    /// Adds an object, if there is one.
    pub fn add(&mut self, of: String, object: Option<ObjectRef>) {
        self.push(of, object, false);
    }

    /// Adds the manifest of a checkpoint.
    pub fn add_manifest(&mut self, of: String, object: Option<ObjectRef>) {
        self.push(of, object, true);
    }

    fn push(&mut self, of: String, object: Option<ObjectRef>, manifest: bool) {
        self.objects.extend(object.map(|object| NamedObject {
            of,
            object,
            manifest,
        }));
    }
}
