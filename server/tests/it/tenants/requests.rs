//! Requests of the contract, made from its descriptors.

use prost_reflect::{
    DescriptorPool, DynamicMessage, FieldDescriptor, Kind, MessageDescriptor, MethodDescriptor,
    Value,
};
use yoto_proto::v1::Scope;

/// Names of one of everything that a tenant has.
#[derive(Debug)]
pub(crate) struct Content {
    pub subject: String,
    pub capture: String,
    pub upload: String,
    pub model: String,
    pub checkpoint: String,
    pub job: String,
    pub worker: String,
    pub object: String,
    pub key: String,
    pub erasure: String,
    pub share: String,
    pub webhook: String,
    pub consent: String,
}

impl Content {
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        let Self {
            subject,
            capture,
            upload,
            model,
            checkpoint,
            job,
            worker,
            object,
            key,
            erasure,
            share,
            webhook,
            consent,
        } = self;
        let all = [
            subject, capture, upload, model, checkpoint, job, worker, object, key, erasure, share,
            webhook, consent,
        ];
        all.into_iter().map(String::as_str)
    }

    /// A name for a field with this name.
    fn of_field(&self, field: &str) -> Option<&str> {
        match field {
            "subject" | "driver" => Some(&self.subject),
            "model" => Some(&self.model),
            "job" => Some(&self.job),
            "worker" => Some(&self.worker),
            _ => None,
        }
    }
}

/// Text fields that hold no name of a resource, or one that is never read, by field or by message and field.
const NO_NAMES: &[&str] = &[
    "ExportMotion.name",
    "adapter",
    "alias",
    "attempts",
    "backend",
    "bones",
    "captures",
    "code",
    "consent_note",
    "display_name",
    "etag",
    "evidence_file_name",
    "field",
    "file",
    "given_by",
    "ingest_job",
    "key",
    "kept_for",
    "leave",
    "message",
    "names",
    "note",
    "owner",
    "page_token",
    "path",
    "paths",
    "protocol",
    "reason",
    "request_id",
    "sha256",
    "shards",
    "slots",
    "tenant",
    "tier",
    "url",
    "variant",
    "version",
];

/// Messages whose names are never answered with NOT_FOUND: a worker's reports on its own lease, which are compared with the
/// leased order; an ingest job, which can't be ordered; and jobs that a watcher knows, which are answered as deleted.
const REPORTS: &[&str] = &[
    "Checkpoint",
    "JobResult",
    "JobError",
    "Progress",
    "IngestSpec",
    "KnownJob",
];

/// What a message needs besides the name in one field to be looked at, as JSON: on the way to a field of it, or to any.
/// `SUBJECT` and `MODEL` stand for those of the caller. Other messages get the caller's names where a field is called
/// `subject`, `driver`, `model`, `job` or `worker`.
const NEEDS: &[(&str, &str)] = &[
    ("CommitOutputRequest", r#"{"file": {}}"#),
    (
        "CreateUploadRequest",
        r#"{"files": [{"path": "poses.json", "bytes": "2",
            "sha256": "0000000000000000000000000000000000000000000000000000000000000000"}]}"#,
    ),
    ("GrantConsentRequest", r#"{"purposes": ["CONSENT_TRAIN"]}"#),
    ("SetAliasRequest", r#"{"alias": "prod"}"#),
    ("EndJobRequest", r#"{"returned": {}}"#),
    ("PublishCheckpointRequest", r#"{"checkpoint": {}}"#),
    ("TakeRangeRequest", r#"{"pictures": 1}"#),
    ("UpdateModelRequest", r#"{"updateMask": "retention"}"#),
    ("UpdateSubjectRequest", r#"{"updateMask": "consentNote"}"#),
    ("TrainSpec", r#"{"seconds": 1}"#),
    ("ExportSpec", r#"{"form": "EXPORT_FORM_PAGE"}"#),
    ("ExportMotion", r#"{"name": "walk"}"#),
    ("RenderSpec", r#"{"orbit": {"views": 1, "size": 8}}"#),
    ("RenderSpec.scene", r#"{"model": "MODEL"}"#),
    ("MotionTransfer", r#"{"frameStep": 1, "size": 8}"#),
    ("CaptureMotion", r#"{"frameStep": 1}"#),
    ("Between", r#"{"shares": [0.5]}"#),
    (
        "Scene",
        r#"{"camera": {"orbit": {}}, "width": 8, "height": 8, "seconds": 1,
            "actors": [{"subject": "SUBJECT", "capture": {"driver": "SUBJECT", "frameStep": 1}}]}"#,
    ),
    (
        "Actor",
        r#"{"capture": {"driver": "SUBJECT", "frameStep": 1}}"#,
    ),
];

/// All methods of the contract.
pub(crate) fn methods() -> Vec<MethodDescriptor> {
    let pool = DescriptorPool::decode(yoto_proto::DESCRIPTORS).expect("descriptors");
    let services: Vec<_> = pool.services().collect();
    services
        .iter()
        .flat_map(|it| it.methods().collect::<Vec<_>>())
        .collect()
}

/// The scope that the contract names beside a method.
pub(crate) fn scope(method: &MethodDescriptor) -> Scope {
    number(method, "scope")
        .expect("has a scope")
        .try_into()
        .expect("a scope")
}

/// Whether the contract says beside a method that it is about the whole service.
pub(crate) fn is_of_whole_service(method: &MethodDescriptor) -> bool {
    number(method, "whole_service") == Some(1)
}

/// An option of a method.
fn number(method: &MethodDescriptor, option: &str) -> Option<i32> {
    let pool = method.parent_pool();
    let known = pool.get_extension_by_name(&format!("yoto.v1.{option}"));
    let known = known.expect("is in the contract");
    let options = method.options();
    if !options.has_extension(&known) {
        return None;
    }
    match options.get_extension(&known).as_ref() {
        Value::EnumNumber(number) => Some(*number),
        Value::Bool(is_set) => Some(i32::from(*is_set)),
        other => panic!("{option} is {other:?}"),
    }
}

/// The id in a name: of the resource, or of the one that it belongs to.
pub(crate) fn id(name: &str) -> &str {
    name.split('/').nth(1).expect("a resource name")
}

/// A name of the same form and length, with an id that nobody has.
pub(crate) fn unknown(name: &str) -> String {
    name.replace(id(name), "00000000-0000-4000-8000-000000000000")
}

/// Paths to all fields of a message that may hold a name.
pub(crate) fn leaves(message: &MessageDescriptor) -> Vec<Vec<FieldDescriptor>> {
    let mut found = Vec::new();
    collect(message, &mut Vec::new(), &mut found);
    found
}

fn collect(
    message: &MessageDescriptor,
    path: &mut Vec<FieldDescriptor>,
    found: &mut Vec<Vec<FieldDescriptor>>,
) {
    for field in message.fields() {
        let full = format!("{}.{}", message.name(), field.name());
        if NO_NAMES.iter().any(|it| [field.name(), &full].contains(it)) || field.is_map() {
            continue;
        }
        let kind = field.kind();
        path.push(field);
        match kind {
            Kind::String => found.push(path.clone()),
            // A message inside itself has no new fields.
            Kind::Message(inner) if !path.iter().any(|it| *it.parent_message() == inner) => {
                collect(&inner, path, found);
            }
            _ => {}
        }
        path.pop();
    }
}

/// Whether the field at the end of `path` is in a message whose names are never answered with NOT_FOUND.
pub(crate) fn is_report(path: &[FieldDescriptor]) -> bool {
    path.iter()
        .any(|it| REPORTS.contains(&it.parent_message().name()))
}

/// A request with `name` in the field at the end of `path`, and otherwise one that the tenant with the content `own` may
/// make.
pub(crate) fn with(
    message: &MessageDescriptor,
    path: &[FieldDescriptor],
    own: &Content,
    name: &str,
) -> DynamicMessage {
    let Some((field, rest)) = path.split_first() else {
        return DynamicMessage::new(message.clone());
    };
    let full = format!("{}.{}", message.name(), field.name());
    let mut request = match needs(&full) {
        Some(json) => parse(message, json, own),
        None => with_own_names(message, own),
    };
    let value = match field.kind() {
        Kind::Message(inner) => Value::Message(with(&inner, rest, own, name)),
        _ => Value::String(name.to_owned()),
    };
    if field.is_list() {
        // Behind those that the message needs.
        if let Value::List(all) = request.get_field_mut(field) {
            all.push(value);
        }
        return request;
    }
    request.set_field(field, value);
    request
}

fn with_own_names(message: &MessageDescriptor, own: &Content) -> DynamicMessage {
    let mut request = parse(message, needs(message.name()).unwrap_or("{}"), own);
    for field in message.fields() {
        let plain = field.kind() == Kind::String && !field.is_list();
        if let (true, None, Some(name)) =
            (plain, field.containing_oneof(), own.of_field(field.name()))
        {
            request.set_field(&field, Value::String(name.to_owned()));
        }
    }
    request
}

fn needs(key: &str) -> Option<&'static str> {
    let found = NEEDS.iter().find(|(it, _)| *it == key);
    found.map(|(_, json)| *json)
}

fn parse(message: &MessageDescriptor, json: &str, own: &Content) -> DynamicMessage {
    let json = json
        .replace("SUBJECT", &own.subject)
        .replace("MODEL", &own.model);
    let mut json = serde_json::Deserializer::from_str(&json);
    DynamicMessage::deserialize(message.clone(), &mut json).expect("fields of the message")
}
