//! What each path needs, by the options of the contract's calls and the rules of the pages.

use crate::sign_in;
use axum::http;
use prost::Message;
use std::collections::HashMap;
use std::sync::LazyLock;
use yoto_dashboard::PageRule;
use yoto_http::transcoding::{self, Needed};
use yoto_proto::v1::Scope;

/// What a caller needs for a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Rule {
    /// Nothing: probes of balancers, which learn one word, and links to pages.
    Open,
    /// Any key.
    Key,
    /// A key with the scope.
    Scope {
        /// The scope.
        scope: Scope,
        /// Whether the key must be one of the tenant of the service's operators.
        whole_service: bool,
        /// Whether the answer is a file, which stays open until the last byte is sent.
        download: bool,
    },
}

impl Rule {
    /// The scope that a key needs, if any does not do.
    pub(super) fn scope(self) -> Option<Scope> {
        match self {
            Self::Scope { scope, .. } => Some(scope),
            Self::Open | Self::Key => None,
        }
    }

    /// Whether the answer is a file, which stays open until the last byte is sent.
    pub(super) fn is_download(self) -> bool {
        matches!(self, Self::Scope { download: true, .. })
    }
}

/// Both versions of reflection: the contract is public, but who asks has a key.
const REFLECTION: [&str; 2] = [
    "/grpc.reflection.v1.ServerReflection/ServerReflectionInfo",
    "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
];

/// The pages of [`crate::pages`].
const PAGES: [(&str, Rule); 3] = [
    ("/healthz", Rule::Open),
    ("/readyz", Rule::Open),
    (
        "/metrics",
        Rule::Scope {
            scope: Scope::Operate,
            whole_service: true,
            download: false,
        },
    ),
];

/// The pages that say in one word how the service is.
const PROBES: [&str; 2] = ["/healthz", "/readyz"];

/// How the names of calls begin that answer with a file.
const DOWNLOAD: &str = "Download";

/// Script and style of the dashboard, which are the same for everybody.
const ASSETS: &str = "/assets/*";
/// The pages behind links, whose addresses are their secrets.
const SHARES: &str = "/share/*";

static RULES: LazyLock<HashMap<String, Rule>> = LazyLock::new(all);

/// The rule of a request; `None` if nothing is there.
pub(super) fn of_request(verb: &http::Method, path: &str) -> Option<Rule> {
    if !transcoding::is_request(path) {
        return of(path);
    }
    match transcoding::needed(verb, path)? {
        Needed::Call(call) => of(call),
        Needed::Contract => Some(Rule::Key),
    }
}

/// The rule of the path; `None` if nothing is there.
fn of(path: &str) -> Option<Rule> {
    let own = RULES.get(path).copied();
    if matches(SHARES, path) {
        return Some(Rule::Open);
    }
    own.or_else(|| of_dashboard(path))
}

fn of_dashboard(path: &str) -> Option<Rule> {
    if matches(ASSETS, path) {
        return Some(Rule::Open);
    }
    RULES.get(page(path)?.call).copied()
}

/// The page for people at this path.
fn page(path: &str) -> Option<&'static PageRule> {
    let mut pages = yoto_dashboard::RULES.iter();
    pages.find(|it| matches(&it.pattern, path))
}

/// Whether the method at this path is one that people call to change something.
pub(crate) fn changes_something(path: &str) -> bool {
    let scope = match of(path) {
        Some(Rule::Scope { scope, .. }) => scope,
        _ => return false,
    };
    matches!(scope, Scope::Write | Scope::Operate) && !looks(path)
}

/// Whether the method is one that looks at what only operators may see.
fn looks(path: &str) -> bool {
    let method = method_of(path);
    method.starts_with("Get") || method.starts_with("List")
}

/// The name of the method at `path`.
fn method_of(path: &str) -> &str {
    path.rsplit('/').next().unwrap_or_default()
}

/// Whether the path is that of a probe.
pub(crate) fn is_probe(path: &str) -> bool {
    PROBES.contains(&path)
}

/// Whether the path is that of a page for people, into which a browser signs in.
pub(super) fn is_of_dashboard(path: &str) -> bool {
    page(path).is_some()
}

/// The pattern of that page, with `*` for ids.
pub(crate) fn page_of(path: &str) -> Option<&'static str> {
    page(path).map(|it| it.pattern.as_str())
}

/// Whether the path is one that only the script of a page asks for.
pub(crate) fn is_of_script(path: &str) -> bool {
    page(path).is_some_and(|it| it.of_script)
}

/// Whether the request to a page for people, or its answer, lasts: an answer of events, or a file that comes or goes.
pub(super) fn streams(verb: &http::Method, path: &str) -> bool {
    page(path).is_some_and(|it| it.lasts) || brings_file(verb, path)
}

/// Whether a page's script sends bytes of a file by this request. It may be long, so nothing waits for all of it.
pub(crate) fn brings_file(verb: &http::Method, path: &str) -> bool {
    verb == http::Method::PUT && page(path).is_some_and(|it| it.takes_file)
}

/// Whether the segments of `path` are those of `pattern`.
fn matches(pattern: &str, path: &str) -> bool {
    let (mut wanted, mut found) = (pattern.split('/'), path.split('/'));
    loop {
        match (wanted.next(), found.next()) {
            (None, None) => return true,
            (Some(wanted), Some(found)) if wanted == found => {}
            (Some("*"), Some(found)) if !found.is_empty() => {}
            _ => return false,
        }
    }
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
                download: method_of(&path).starts_with(DOWNLOAD),
            };
            rules.insert(path, rule);
        }
    }
    for (path, _) in methods(tonic_health::pb::FILE_DESCRIPTOR_SET) {
        rules.insert(path, Rule::Open);
    }
    rules.extend(REFLECTION.map(|path| (path.to_owned(), Rule::Key)));
    rules.extend(sign_in::OPEN.map(|path| (path.to_owned(), Rule::Open)));
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
                scope != Scope::Read || looks || path.contains("Download"),
                "{path}"
            );
        }
    }

    #[test]
    fn each_page_for_people_has_the_rule_of_a_call() {
        for PageRule {
            pattern: page,
            call,
            ..
        } in yoto_dashboard::RULES.iter()
        {
            assert!(RULES.contains_key(*call), "{page}: {call}");
            assert_eq!(of(&page.replace('*', "x")), of(call), "{page}");
        }
        let scope = |path: &str| match of(path) {
            Some(Rule::Scope { scope, .. }) => Some(scope),
            _ => None,
        };
        assert_eq!(scope("/people/ada"), Some(Scope::Read));
        assert_eq!(scope("/jobs/1/cancel"), Some(Scope::Write));
        assert_eq!(scope("/workers/cordon"), Some(Scope::Operate));
        for part in [
            "person",
            "files",
            "files/7",
            "files/7/a",
            "finish/7",
            "cancel/7",
        ] {
            let path = format!("/people/upload/{part}");
            assert_eq!(scope(&path), Some(Scope::Write), "{path}");
        }
        assert_eq!(of("/assets/page.js"), Some(Rule::Open));
        assert_eq!(of("/share/0123"), Some(Rule::Open));
    }

    #[test]
    fn a_call_over_http_has_the_rule_of_the_call() {
        for (verb, path, call) in [
            (
                http::Method::GET,
                "/v1/jobs/7",
                "/yoto.v1.JobService/GetJob",
            ),
            (
                http::Method::POST,
                "/v1/jobs",
                "/yoto.v1.JobService/CreateJob",
            ),
            (
                http::Method::POST,
                "/v1/service:drain",
                "/yoto.v1.StatusService/Drain",
            ),
            (
                http::Method::PUT,
                "/v1/uploads/7/files/a",
                "/yoto.v1.UploadService/WriteUpload",
            ),
        ] {
            assert_eq!(of_request(&verb, path), of(call), "{path}");
            assert!(of(call).is_some(), "{call}");
        }
        let description = of_request(&http::Method::GET, "/v1/openapi.json");
        assert_eq!(description, Some(Rule::Key));
        assert_eq!(of_request(&http::Method::PUT, "/v1/jobs"), None);
        assert_eq!(of_request(&http::Method::GET, "/v1/nothing"), None);
        assert_eq!(of_request(&http::Method::GET, "/readyz"), Some(Rule::Open));
    }

    #[test]
    fn downloads_are_known_in_each_form() {
        let is_download =
            |verb: &http::Method, path: &str| of_request(verb, path).is_some_and(Rule::is_download);
        let (get, post) = (&http::Method::GET, &http::Method::POST);
        assert!(is_download(post, "/yoto.v1.ObjectService/DownloadObject"));
        assert!(is_download(get, "/v1/jobs/7/objects/avatar.html:download"));
        assert!(is_download(get, "/jobs/7/files/avatar.html"));
        assert!(!is_download(get, "/v1/jobs/7"));
        assert!(!is_download(get, "/jobs/7"));
    }

    #[test]
    fn what_has_no_rule_is_not_there() {
        for path in [
            "",
            "/metrics/",
            "/people/",
            "/people/1/2",
            "/people/upload/files/7/a/b",
            "/people/upload/erase/7",
            "/assets/",
            "/share/",
            "/share/a/b",
            "/models/1/delete",
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
            download: false,
        };
        assert_eq!(of("/metrics"), Some(figures));
        assert_eq!(of("/yoto.v1.StorageService/CollectGarbage"), Some(figures));
    }
}
