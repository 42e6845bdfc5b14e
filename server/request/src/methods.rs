//! What the contract's descriptors say of its services: their names, for their health, and which calls are unary, for the
//! layers that treat streams differently.

use prost::Message;
use prost_reflect::DescriptorPool;
use prost_types::{
    FileDescriptorProto, FileDescriptorSet, MethodDescriptorProto, ServiceDescriptorProto,
};
use std::collections::{HashMap, HashSet};
use std::sync::LazyLock;

/// The contract's messages and calls, to be read and written without their types.
pub static POOL: LazyLock<DescriptorPool> =
    LazyLock::new(|| DescriptorPool::decode(yoto_proto::DESCRIPTORS).unwrap_or_default());
/// All services of the contract by their full names.
static SERVICES: LazyLock<Vec<(String, ServiceDescriptorProto)>> = LazyLock::new(described);
/// Paths of all unary methods.
static UNARY: LazyLock<HashSet<String>> = LazyLock::new(unary_paths);

/// The requests of all methods by their paths.
static REQUESTS: LazyLock<HashMap<String, String>> =
    LazyLock::new(|| messages(|it| it.input_type()));
/// The responses of all methods by their paths.
static RESPONSES: LazyLock<HashMap<String, String>> =
    LazyLock::new(|| messages(|it| it.output_type()));

/// Full name of the request of the method at `path`, with a leading dot; `None` for services that are not of the contract.
pub fn request(path: &str) -> Option<&'static str> {
    REQUESTS.get(path).map(String::as_str)
}

/// Full name of the response of the method at `path`, as [`request`].
pub fn response(path: &str) -> Option<&'static str> {
    RESPONSES.get(path).map(String::as_str)
}

/// Whether `path`, such as `/yoto.v1.JobService/GetJob`, is that of a unary method: one request, one response.
pub fn is_unary(path: &str) -> bool {
    UNARY.contains(path)
}

/// Full names of all services, such as `yoto.v1.JobService`.
pub fn services() -> impl Iterator<Item = &'static str> {
    SERVICES.iter().map(|(name, _)| name.as_str())
}

fn described() -> Vec<(String, ServiceDescriptorProto)> {
    let files = FileDescriptorSet::decode(yoto_proto::DESCRIPTORS).unwrap_or_default();
    let of_file = |file: FileDescriptorProto| {
        let package = file.package().to_owned();
        let services = file.service.into_iter();
        services.map(move |service| (format!("{package}.{}", service.name()), service))
    };
    files.file.into_iter().flat_map(of_file).collect()
}

fn unary_paths() -> HashSet<String> {
    let mut paths = HashSet::new();
    for (name, service) in SERVICES.iter() {
        let methods = service.method.iter();
        let unary = methods.filter(|it| !it.client_streaming() && !it.server_streaming());
        paths.extend(unary.map(|method| format!("/{name}/{}", method.name())));
    }
    paths
}

/// A message of each method by its path.
fn messages(of: fn(&MethodDescriptorProto) -> &str) -> HashMap<String, String> {
    let all = SERVICES.iter().flat_map(|(name, service)| {
        let path = move |method: &str| format!("/{name}/{method}");
        let methods = service.method.iter();
        methods.map(move |it| (path(it.name()), of(it).to_owned()))
    });
    all.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_with_streams_are_not_unary() {
        assert!(
            is_unary("/yoto.worker.v1.WorkerService/EndJob"),
            "{UNARY:?}"
        );
        assert!(!is_unary("/yoto.v1.JobService/WatchJob"), "{UNARY:?}");
        assert!(!is_unary("/yoto.v1.ObjectService/DownloadObject"));
    }

    #[test]
    fn all_methods_have_requests() {
        let found = request("/yoto.v1.JobService/GetJob");
        assert_eq!(found, Some(".yoto.v1.GetJobRequest"));
        assert_eq!(request("/grpc.health.v1.Health/Check"), None);
    }

    #[test]
    fn all_services_have_names() {
        let names: Vec<_> = services().collect();
        assert_eq!(names.len(), 13, "{names:?}");
        assert!(names.contains(&"yoto.worker.v1.WorkerService"));
    }
}
