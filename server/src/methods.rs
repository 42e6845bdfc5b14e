//! What the contract's descriptors say of its services: their names, for their health, and which calls are unary, for the
//! layers that treat streams differently.

use prost::Message;
use prost_types::{FileDescriptorProto, FileDescriptorSet, ServiceDescriptorProto};
use std::collections::HashSet;
use std::sync::LazyLock;

/// All services of the contract by their full names.
static SERVICES: LazyLock<Vec<(String, ServiceDescriptorProto)>> = LazyLock::new(described);
/// Paths of all unary methods.
static UNARY: LazyLock<HashSet<String>> = LazyLock::new(unary_paths);

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
    fn all_services_have_names() {
        let names: Vec<_> = services().collect();
        assert_eq!(names.len(), 9, "{names:?}");
        assert!(names.contains(&"yoto.worker.v1.WorkerService"));
    }
}
