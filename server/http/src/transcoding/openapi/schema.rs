//! Messages and enumerations of the contract as JSON schemas.

use prost_reflect::{
    EnumDescriptor, FieldDescriptor, FileDescriptor, Kind, MessageDescriptor, MethodDescriptor,
};
use serde_json::{Map, Value, json};

/// The schemas that the description refers to.
#[derive(Debug, Default)]
pub(super) struct Schemas(Map<String, Value>);

impl Schemas {
    /// A reference to the schema of a message.
    pub(super) fn message(&mut self, message: &MessageDescriptor) -> Value {
        if let Some(known) = well_known(message.full_name()) {
            return known;
        }
        let name = short(message.full_name(), message.package_name());
        if !self.0.contains_key(&name) {
            // Before its fields: a message may contain itself.
            self.0.insert(name.clone(), Value::Null);
            let mut properties = Map::new();
            for field in message.fields() {
                properties.insert(field.name().to_owned(), self.field(&field));
            }
            let mut schema = json!({ "type": "object", "properties": properties });
            describe(
                &mut schema,
                &comment(&message.parent_file(), message.path()),
            );
            self.0.insert(name.clone(), schema);
        }
        reference(&name)
    }

    /// The schema of a field, with what the contract says of it.
    pub(super) fn field(&mut self, field: &FieldDescriptor) -> Value {
        let mut schema = match field.kind() {
            Kind::Message(entry) if field.is_map() => {
                let value = self.kind(&entry.map_entry_value_field());
                json!({ "type": "object", "additionalProperties": value })
            }
            _ if field.is_list() => json!({ "type": "array", "items": self.kind(field) }),
            _ => self.kind(field),
        };
        let file = field.parent_message().parent_file();
        describe(&mut schema, &comment(&file, field.path()));
        schema
    }

    fn kind(&mut self, field: &FieldDescriptor) -> Value {
        match field.kind() {
            Kind::Bool => json!({ "type": "boolean" }),
            Kind::String => json!({ "type": "string" }),
            Kind::Bytes => json!({ "type": "string", "contentEncoding": "base64" }),
            Kind::Float => json!({ "type": "number", "format": "float" }),
            Kind::Double => json!({ "type": "number", "format": "double" }),
            Kind::Int32 | Kind::Sint32 | Kind::Sfixed32 => {
                json!({ "type": "integer", "format": "int32" })
            }
            Kind::Int64 | Kind::Sint64 | Kind::Sfixed64 => {
                json!({ "type": "integer", "format": "int64" })
            }
            Kind::Uint32 | Kind::Fixed32 | Kind::Uint64 | Kind::Fixed64 => {
                json!({ "type": "integer", "minimum": 0 })
            }
            Kind::Message(message) => self.message(&message),
            Kind::Enum(kind) => self.enumeration(&kind),
        }
    }

    fn enumeration(&mut self, kind: &EnumDescriptor) -> Value {
        let name = short(kind.full_name(), kind.package_name());
        if !self.0.contains_key(&name) {
            let mut told = comment(&kind.parent_file(), kind.path());
            let mut names = Vec::new();
            for value in kind.values() {
                let of_value = comment(&kind.parent_file(), value.path());
                if !of_value.is_empty() {
                    told += &format!("\n- {}: {of_value}", value.name());
                }
                names.push(value.name().to_owned());
            }
            let mut schema = json!({ "type": "string", "enum": names });
            describe(&mut schema, told.trim());
            self.0.insert(name.clone(), schema);
        }
        reference(&name)
    }

    /// All schemas by their names.
    pub(super) fn into_all(self) -> Map<String, Value> {
        self.0
    }
}

/// Messages with a form of their own in JSON (<https://protobuf.dev/programming-guides/json/>).
fn well_known(name: &str) -> Option<Value> {
    let text = |format: &str| json!({ "type": "string", "format": format });
    Some(match name {
        "google.protobuf.Timestamp" => text("date-time"),
        "google.protobuf.Duration" => json!({ "type": "string", "pattern": "^-?[0-9.]+s$" }),
        "google.protobuf.FieldMask" => json!({ "type": "string" }),
        "google.protobuf.Struct" | "google.protobuf.Any" => json!({ "type": "object" }),
        _ => return None,
    })
}

/// The name without its package, as nested types are written: `Job.State`.
fn short(full: &str, package: &str) -> String {
    let name = full.strip_prefix(package).unwrap_or(full);
    name.trim_start_matches('.').to_owned()
}

fn reference(name: &str) -> Value {
    json!({ "$ref": format!("#/components/schemas/{name}") })
}

/// Adds what is said of it, if something is.
fn describe(schema: &mut Value, told: &str) {
    if !told.is_empty() {
        schema["description"] = told.into();
    }
}

/// What the contract says of a call.
pub(super) fn of_method(method: &MethodDescriptor) -> String {
    comment(&method.parent_service().parent_file(), method.path())
}

/// The comment before the element at `path`, or the one behind it, without line breaks within a paragraph.
fn comment(file: &FileDescriptor, path: &[i32]) -> String {
    let info = file.file_descriptor_proto().source_code_info.as_ref();
    let locations = info.into_iter().flat_map(|it| &it.location);
    let mut comments = locations.filter(|it| it.path == path).map(|it| {
        let (before, behind) = (it.leading_comments(), it.trailing_comments());
        if before.is_empty() { behind } else { before }.to_owned()
    });
    let text = comments.next().unwrap_or_default();
    let paragraphs = text.split("\n\n").map(|paragraph| {
        let words: Vec<&str> = paragraph.split_whitespace().collect();
        words.join(" ")
    });
    let paragraphs: Vec<String> = paragraphs.filter(|it| !it.is_empty()).collect();
    paragraphs.join("\n\n")
}
