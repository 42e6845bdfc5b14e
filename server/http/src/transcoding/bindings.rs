//! Which call each HTTP request is: the option `google.api.http` beside the calls of the contract.

use super::template::Template;
use axum::http::Method;
use prost_reflect::{DynamicMessage, MethodDescriptor, Value};
use std::sync::LazyLock;
use yoto_request::methods::POOL;

/// Name of the option.
const OPTION: &str = "google.api.http";
/// Under which all paths are.
pub(super) const PREFIX: &str = "/v1/";

/// The call whose answer is the bytes of a file.
pub(super) const DOWNLOAD: &str = "/yoto.v1.ObjectService/DownloadObject";

static BINDINGS: LazyLock<Vec<Binding>> = LazyLock::new(all);

/// An HTTP request for a call.
#[derive(Debug)]
pub(super) struct Binding {
    /// GET, POST, PATCH or DELETE.
    pub verb: Method,
    /// The path.
    pub template: Template,
    /// What the body is.
    pub body: BodyOf,
    /// The call.
    pub method: MethodDescriptor,
    /// Its path in gRPC: `/yoto.v1.JobService/GetJob`.
    pub path: String,
}

/// What the body of a request is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum BodyOf {
    /// Nothing: the fields are in the query.
    Nothing,
    /// All fields that the path does not have.
    Message,
    /// This field.
    Field(String),
}

/// A request that is a call.
#[derive(Debug)]
pub(super) struct BoundCall {
    /// Which.
    pub binding: &'static Binding,
    /// Values of fields in the path.
    pub values: Vec<(&'static str, String)>,
}

impl Binding {
    /// Whether the answer is a stream.
    pub(super) fn streams(&self) -> bool {
        self.method.is_server_streaming()
    }
}

/// All requests, in the order of the contract.
pub(super) fn bindings() -> &'static [Binding] {
    &BINDINGS
}

/// The call of a request. HEAD is as GET. Where a path of any length fits too, the other one is meant.
pub(super) fn find(verb: &Method, path: &str) -> Option<BoundCall> {
    if !path.starts_with(PREFIX) {
        return None;
    }
    let verb = if verb == Method::HEAD {
        &Method::GET
    } else {
        verb
    };
    let of_verb = BINDINGS.iter().filter(|it| it.verb == verb);
    of_verb
        .filter_map(|binding| {
            let values = binding.template.values(path)?;
            Some(BoundCall { binding, values })
        })
        .min_by_key(|found| found.binding.template.has_any_length())
}

fn all() -> Vec<Binding> {
    let services = POOL.services();
    let methods = services.flat_map(|service| service.methods().collect::<Vec<_>>());
    methods.filter_map(binding).collect()
}

fn binding(method: MethodDescriptor) -> Option<Binding> {
    let option = POOL.get_extension_by_name(OPTION)?;
    let options = method.options();
    if !options.has_extension(&option) {
        return None;
    }
    let rule = options.get_extension(&option);
    let rule = rule.as_message()?;
    let text = |name: &str| match rule.get_field_by_name(name).as_deref() {
        Some(Value::String(text)) if !text.is_empty() => Some(text.clone()),
        _ => None,
    };
    let verbs = [
        ("get", Method::GET),
        ("post", Method::POST),
        ("patch", Method::PATCH),
        ("delete", Method::DELETE),
    ];
    let (verb, template) = verbs
        .into_iter()
        .find_map(|(name, verb)| Some((verb, text(name)?)))?;
    let body = match text("body").as_deref() {
        None => BodyOf::Nothing,
        Some("*") => BodyOf::Message,
        Some(field) => BodyOf::Field(field.to_owned()),
    };
    let path = format!("/{}/{}", method.parent_service().full_name(), method.name());
    Some(Binding {
        verb,
        template: Template::read(&template)?,
        body,
        path,
        method,
    })
}

/// An empty request of the call.
pub(super) fn empty(method: &MethodDescriptor) -> DynamicMessage {
    DynamicMessage::new(method.input())
}

#[cfg(test)]
mod tests {
    use super::super::template::Piece;
    use super::*;
    use std::collections::HashSet;

    fn called(verb: Method, path: &str) -> Option<&'static str> {
        find(&verb, path).map(|it| it.binding.path.as_str())
    }

    /// WriteUpload is the one call with a stream of requests; it has a path of its own.
    #[test]
    fn each_call_for_users_is_an_http_request() {
        let own: HashSet<_> = BINDINGS.iter().map(|it| it.path.as_str()).collect();
        for service in POOL.services().filter(|it| it.package_name() == "yoto.v1") {
            for method in service.methods().filter(|it| !it.is_client_streaming()) {
                let path = format!("/{}/{}", service.full_name(), method.name());
                assert!(own.contains(path.as_str()), "{path} has no {OPTION}");
            }
        }
        assert!(own.iter().all(|it| !it.starts_with("/yoto.worker.")));
    }

    #[test]
    fn fields_of_paths_and_bodies_are_fields_of_the_requests() {
        for Binding {
            template,
            body,
            method,
            path,
            ..
        } in bindings()
        {
            let fields = template.fields().map(ToOwned::to_owned);
            let body = match body {
                BodyOf::Field(field) => Some(field.clone()),
                _ => None,
            };
            for field in fields.chain(body) {
                let mut message = method.input();
                let mut names = field.split('.').peekable();
                while let Some(name) = names.next() {
                    let found = message.get_field_by_name(name);
                    let found = found.unwrap_or_else(|| panic!("{path}: {field}"));
                    if names.peek().is_some() {
                        let kind = found.kind();
                        message = kind.as_message().expect("a message").clone();
                    }
                }
            }
        }
    }

    #[test]
    fn each_request_is_the_call_that_it_names() {
        for binding in bindings() {
            let pieces: Vec<_> = binding
                .template
                .pieces()
                .map(|piece| match piece {
                    Piece::Literal(literal) => literal,
                    Piece::Value { many: false, .. } => "7",
                    Piece::Value { many: true, .. } => "jobs/7",
                })
                .collect();
            let verb = match binding.template.verb() {
                "" => String::new(),
                verb => format!(":{verb}"),
            };
            let path = format!("/{}{verb}", pieces.join("/"));
            assert_eq!(
                called(binding.verb.clone(), &path),
                Some(binding.path.as_str()),
                "{} {path}",
                binding.verb
            );
        }
        let job = "/yoto.v1.JobService/GetJob";
        assert_eq!(called(Method::HEAD, "/v1/jobs/7"), Some(job));
        assert_eq!(called(Method::PUT, "/v1/jobs/7"), None);
        assert_eq!(called(Method::GET, "/v1/nothing"), None);
        assert_eq!(called(Method::GET, "/jobs/7"), None);
    }
}
