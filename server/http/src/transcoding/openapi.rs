//! A description of all requests in OpenAPI 3.1, from the contract and its comments.

mod operation;
mod schema;

use super::bindings::bindings;
use schema::Schemas;
use serde_json::{Map, Value, json};
use std::sync::LazyLock;

/// The description as text.
pub(super) static TEXT: LazyLock<String> = LazyLock::new(|| document().to_string());

/// The description.
fn document() -> Value {
    let mut schemas = Schemas::default();
    let mut paths: Map<String, Value> = Map::new();
    for binding in bindings() {
        let (path, operation) = operation::of(binding, &mut schemas);
        let path = paths.entry(path).or_insert_with(|| json!({}));
        path[binding.verb.as_str().to_lowercase()] = operation;
    }
    let (path, operation) = operation::upload(&mut schemas);
    paths.insert(path, json!({ "put": operation }));
    json!({
        "openapi": "3.1.0",
        "info": {
            "title": "yoto",
            "version": env!("CARGO_PKG_VERSION"),
            "description": "Trains avatars of people from videos, and renders them. The same calls as those of gRPC.",
            "license": { "name": "MIT OR Apache-2.0", "identifier": "MIT OR Apache-2.0" },
        },
        "servers": [{ "url": "/" }],
        "paths": paths,
        "components": {
            "schemas": schemas.into_all(),
            "responses": { "Problem": problem() },
            "securitySchemes": {
                "key": {
                    "type": "http",
                    "scheme": "bearer",
                    "description": "A key, if the service asks for one: `yoto key create` makes it.",
                },
            },
        },
        "security": [{}, { "key": [] }],
    })
}

/// What all errors are.
fn problem() -> Value {
    let fault = |name: &str| {
        json!({
            "type": "array",
            "items": {
                "type": "object",
                "properties": {
                    name: { "type": "string" },
                    "subject": { "type": "string" },
                    "detail": { "type": "string" },
                },
            },
        })
    };
    json!({
        "description": "An error (RFC 9457).",
        "content": { "application/problem+json": { "schema": {
            "type": "object",
            "required": ["title", "status", "detail"],
            "properties": {
                "type": { "type": "string" },
                "title": { "type": "string", "description": "The code of gRPC, such as NOT_FOUND." },
                "status": { "type": "integer" },
                "detail": { "type": "string" },
                "reason": { "type": "string", "description": "Of `ErrorReason`, for programs." },
                "fields": fault("field"),
                "conditions": fault("reason"),
            },
        } } },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    /// All values of the key `$ref` in `value`.
    fn references(value: &Value, found: &mut HashSet<String>) {
        match value {
            Value::Object(fields) => {
                for (name, value) in fields {
                    match value {
                        Value::String(text) if name == "$ref" => {
                            found.insert(text.clone());
                        }
                        value => references(value, found),
                    }
                }
            }
            Value::Array(values) => values.iter().for_each(|it| references(it, found)),
            _ => {}
        }
    }

    #[test]
    fn each_reference_leads_somewhere() {
        let document = document();
        let mut found = HashSet::new();
        references(&document, &mut found);
        assert!(found.len() > 50, "{}", found.len());
        for reference in found {
            let path = reference.strip_prefix('#').expect("within the document");
            assert!(document.pointer(path).is_some(), "{reference}");
        }
    }

    #[test]
    fn each_call_is_described_once() {
        let document = document();
        let mut ids = HashSet::new();
        let paths = document["paths"].as_object().expect("paths");
        for (path, item) in paths {
            for (verb, operation) in item.as_object().expect("operations") {
                let id = operation["operationId"].as_str().expect("an id");
                assert!(ids.insert(id.to_owned()), "{id} twice");
                let told = operation["description"].as_str();
                assert!(told.is_some_and(|it| !it.is_empty()), "{verb} {path}");
                let holes = path.matches('{').count();
                let parameters = operation["parameters"].as_array();
                let of_path = parameters.into_iter().flatten();
                let of_path = of_path.filter(|it| it["in"] == "path").count();
                assert_eq!(holes, of_path, "{verb} {path}");
            }
        }
        assert_eq!(ids.len(), bindings().len() + 1);
        let job = &document["paths"]["/v1/jobs/{job}"]["get"];
        assert_eq!(job["operationId"], "GetJob");
    }
}
