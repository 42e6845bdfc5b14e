//! What each path needs, by the options of the contract's calls and the rules of the pages.

use prost::Message;
use std::collections::HashMap;
use std::sync::LazyLock;
use yoto_proto::v1::Scope;

/// What a caller needs for a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rule {
    /// Nothing: probes of balancers, which learn one word.
    Open,
    /// Any key.
    Key,
    /// A key with the scope.
    Scope {
        /// The scope.
        scope: Scope,
        /// Whether the key must be one of the tenant of the service's operators.
        whole_service: bool,
    },
}

/// Both versions of reflection: the contract is public, but who asks has a key.
const REFLECTION: [&str; 2] = [
    "/grpc.reflection.v1.ServerReflection/ServerReflectionInfo",
    "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
];

/// The pages of [`crate::http`].
const PAGES: [(&str, Rule); 3] = [
    ("/healthz", Rule::Open),
    ("/readyz", Rule::Open),
    (
        "/metrics",
        Rule::Scope {
            scope: Scope::Operate,
            whole_service: true,
        },
    ),
];

static RULES: LazyLock<HashMap<String, Rule>> = LazyLock::new(all);

/// The rule of the path; `None` if nothing is there.
pub fn of(path: &str) -> Option<Rule> {
    RULES.get(path).copied()
}

fn all() -> HashMap<String, Rule> {
    let mut rules = HashMap::new();
    for (path, options) in methods(yoto_proto::DESCRIPTORS) {
        let scope = options.and_then(|it| Some((it.scope?, it.whole_service.unwrap_or_default())));
        let Some((scope, whole_service)) = scope else {
            continue;
        };
        if let Ok(scope @ (Scope::Read | Scope::Write | Scope::Operate | Scope::Work)) =
            scope.try_into()
        {
            let rule = Rule::Scope {
                scope,
                whole_service,
            };
            rules.insert(path, rule);
        }
    }
    for (path, _) in methods(tonic_health::pb::FILE_DESCRIPTOR_SET) {
        rules.insert(path, Rule::Open);
    }
    rules.extend(REFLECTION.map(|path| (path.to_owned(), Rule::Key)));
    rules.extend(PAGES.map(|(path, rule)| (path.to_owned(), rule)));
    rules
}

/// Paths of all methods with their options. The types of prost leave options of the contract's own out.
fn methods(descriptors: &[u8]) -> Vec<(String, Option<Options>)> {
    let files = Files::decode(descriptors).unwrap_or_default().file;
    let mut found = Vec::new();
    for file in files {
        for service in file.service {
            for method in service.method {
                let path = format!("/{}.{}/{}", file.package, service.name, method.name);
                found.push((path, method.options));
            }
        }
    }
    found
}

/// `google.protobuf.FileDescriptorSet`, as far as it is read here.
#[derive(Clone, PartialEq, Message)]
struct Files {
    #[prost(message, repeated, tag = "1")]
    file: Vec<File>,
}

#[derive(Clone, PartialEq, Message)]
struct File {
    #[prost(string, tag = "2")]
    package: String,
    #[prost(message, repeated, tag = "6")]
    service: Vec<Service>,
}

#[derive(Clone, PartialEq, Message)]
struct Service {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(message, repeated, tag = "2")]
    method: Vec<Method>,
}

#[derive(Clone, PartialEq, Message)]
struct Method {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(message, optional, tag = "4")]
    options: Option<Options>,
}

/// The options of `yoto/v1/access.proto`.
#[derive(Clone, PartialEq, Message)]
struct Options {
    #[prost(int32, optional, tag = "50600")]
    scope: Option<i32>,
    #[prost(bool, optional, tag = "50601")]
    whole_service: Option<bool>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_call_of_the_contract_has_a_scope() {
        let methods = methods(yoto_proto::DESCRIPTORS);
        assert!(methods.len() > 50, "{}", methods.len());
        for (path, _) in methods {
            let rule = of(&path);
            let Some(Rule::Scope { scope, .. }) = rule else {
                panic!("{path} has no scope in its .proto file");
            };
            let of_worker = path.starts_with("/yoto.worker.");
            assert_eq!(scope == Scope::Work, of_worker, "{path}");
            let looks = path.contains("/Get") || path.contains("/List") || path.contains("/Watch");
            assert!(
                scope != Scope::Read || looks || path.contains("/Download"),
                "{path}"
            );
        }
    }

    #[test]
    fn what_has_no_rule_is_not_there() {
        for path in [
            "",
            "/",
            "/metrics/",
            "/yoto.v1.JobService/Nothing",
            "/grpc.health.v1.Health",
        ] {
            assert_eq!(of(path), None, "{path}");
        }
        assert_eq!(of("/grpc.health.v1.Health/Check"), Some(Rule::Open));
        assert_eq!(of("/readyz"), Some(Rule::Open));
        let figures = Rule::Scope {
            scope: Scope::Operate,
            whole_service: true,
        };
        assert_eq!(of("/metrics"), Some(figures));
        assert_eq!(of("/yoto.v1.StorageService/CollectGarbage"), Some(figures));
    }
}
