//! Calls as operations of OpenAPI.

use super::super::bindings::{Binding, BodyOf, DOWNLOAD};
use super::super::template::Piece;
use super::schema::{Schemas, of_method};
use prost_reflect::{FieldDescriptor, Kind};
use serde_json::{Value, json};
use yoto_request::methods::POOL;

/// Path and operation of a call.
pub(super) fn of(binding: &'static Binding, schemas: &mut Schemas) -> (String, Value) {
    let (path, mut parameters) = path(binding);
    let method = &binding.method;
    let in_path: Vec<&str> = binding.template.fields().collect();
    let in_query = |field: &FieldDescriptor| {
        let taken = in_path
            .iter()
            .any(|it| it.split('.').next() == Some(field.name()));
        let of_body = match &binding.body {
            BodyOf::Nothing => false,
            BodyOf::Message => true,
            BodyOf::Field(body) => body == field.name(),
        };
        !taken && !of_body && binding.path != DOWNLOAD && is_scalar(field)
    };
    for field in method.input().fields().filter(in_query) {
        let mut schema = schemas.field(&field);
        let told = schema
            .as_object_mut()
            .and_then(|it| it.remove("description"));
        let mut parameter = json!({ "name": field.name(), "in": "query", "schema": schema });
        if let Some(told) = told {
            parameter["description"] = told;
        }
        parameters.push(parameter);
    }
    let mut operation = json!({
        "operationId": method.name(),
        "tags": [method.parent_service().name()],
        "description": told(binding),
        "responses": { "200": answer(binding, schemas), "default": problem() },
    });
    if !parameters.is_empty() {
        operation["parameters"] = parameters.into();
    }
    let body = match &binding.body {
        BodyOf::Nothing => None,
        BodyOf::Message => Some(schemas.message(&method.input())),
        BodyOf::Field(field) => {
            let field = method.input().get_field_by_name(field);
            field.map(|it| schemas.field(&it))
        }
    };
    if let Some(schema) = body {
        operation["requestBody"] =
            json!({ "content": { "application/json": { "schema": schema } } });
    }
    (path, operation)
}

/// Path and operation of the call that writes bytes of an upload.
pub(super) fn upload(schemas: &mut Schemas) -> (String, Value) {
    let text = |name: &str, told: &str| {
        json!({
            "name": name, "in": "path", "required": true, "description": told,
            "schema": { "type": "string" },
        })
    };
    let range = json!({
        "name": "Content-Range", "in": "header", "schema": { "type": "string" },
        "description": "`bytes FIRST-LAST/SIZE`, if the body is a part of the file. FIRST is the number of committed bytes.",
    });
    let answer = POOL
        .get_message_by_name("yoto.v1.WriteUploadResponse")
        .map(|it| schemas.message(&it));
    let operation = json!({
        "operationId": "WriteUpload",
        "tags": ["UploadService"],
        "description": "Writes bytes of a file of an upload. The answer comes once all of them are on disk.",
        "parameters": [
            text("upload", "The id of the upload."),
            text("path", "The path of the file in the upload. Its slashes may be encoded."),
            range,
        ],
        "requestBody": { "required": true, "content": {
            "application/octet-stream": { "schema": { "type": "string", "format": "binary" } },
        } },
        "responses": {
            "200": {
                "description": "The bytes are on disk.",
                "content": { "application/json": { "schema": answer } },
            },
            "default": problem(),
        },
    });
    ("/v1/uploads/{upload}/files/{path}".to_owned(), operation)
}

/// The path, and its parameters: a hole is called as the collection before it, or as its field.
fn path(binding: &'static Binding) -> (String, Vec<Value>) {
    let mut path = String::new();
    let mut parameters = Vec::new();
    let mut before = "";
    for piece in binding.template.pieces() {
        path.push('/');
        match piece {
            Piece::Literal(literal) => {
                path += literal;
                before = literal;
            }
            Piece::Value { field, many } => {
                let name = if many {
                    field
                } else {
                    before.trim_end_matches('s')
                };
                let told = match many {
                    true => "A name with slashes, which may be encoded: `jobs/{id}`.",
                    false => "An id: what stands behind the slash of a name.",
                };
                path += &format!("{{{name}}}");
                parameters.push(json!({
                    "name": name, "in": "path", "required": true, "description": told,
                    "schema": { "type": "string" },
                }));
            }
        }
    }
    if !binding.template.verb().is_empty() {
        path += &format!(":{}", binding.template.verb());
    }
    (path, parameters)
}

fn is_scalar(field: &FieldDescriptor) -> bool {
    match field.kind() {
        Kind::Message(message) => message.full_name() == "google.protobuf.FieldMask",
        _ => true,
    }
}

/// The comment of the call in the contract, or its name in words if it has none: "List jobs."
fn told(binding: &Binding) -> String {
    let told = of_method(&binding.method);
    if !told.is_empty() {
        return told;
    }
    let mut words = String::new();
    for letter in binding.method.name().chars() {
        if letter.is_uppercase() && !words.is_empty() {
            words.push(' ');
            words.extend(letter.to_lowercase());
        } else {
            words.push(letter);
        }
    }
    format!("{words}.")
}

fn answer(binding: &'static Binding, schemas: &mut Schemas) -> Value {
    if binding.path == DOWNLOAD {
        let bytes = json!({ "schema": { "type": "string", "format": "binary" } });
        return json!({
            "description": "The file, or the range of it that the header Range asks for.",
            "content": { "application/octet-stream": bytes },
        });
    }
    let schema = schemas.message(&binding.method.output());
    if binding.streams() {
        return json!({
            "description": "One object per line, or one per event if the header Accept has text/event-stream.",
            "content": {
                "application/x-ndjson": { "schema": schema },
                "text/event-stream": { "schema": { "type": "string" } },
            },
        });
    }
    json!({ "description": "Done.", "content": { "application/json": { "schema": schema } } })
}

fn problem() -> Value {
    json!({ "$ref": "#/components/responses/Problem" })
}
