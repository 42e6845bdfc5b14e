//! Tells unary calls from streams by the contract's descriptors, for the layers that treat them differently.

use prost::Message;
use prost_types::FileDescriptorSet;
use std::collections::HashSet;
use std::sync::LazyLock;

/// Paths of all unary methods.
static UNARY: LazyLock<HashSet<String>> = LazyLock::new(unary_paths);

/// Whether `path`, such as `/yoto.v1.JobService/GetJob`, is that of a unary method: one request, one response.
pub fn is_unary(path: &str) -> bool {
    UNARY.contains(path)
}

fn unary_paths() -> HashSet<String> {
    let files = FileDescriptorSet::decode(yoto_proto::DESCRIPTORS).unwrap_or_default();
    let mut paths = HashSet::new();
    for file in &files.file {
        for service in &file.service {
            let unary = service
                .method
                .iter()
                .filter(|method| !method.client_streaming() && !method.server_streaming());
            paths.extend(
                unary.map(|method| {
                    format!("/{}.{}/{}", file.package(), service.name(), method.name())
                }),
            );
        }
    }
    paths
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_with_streams_are_not_unary() {
        assert!(is_unary("/yoto.v1.WorkerService/EndJob"), "{UNARY:?}");
        assert!(!is_unary("/yoto.v1.JobService/WatchJob"), "{UNARY:?}");
        assert!(!is_unary("/yoto.v1.ObjectService/DownloadObject"));
    }
}
