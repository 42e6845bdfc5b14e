//! The methods of the contract.

use prost::Message;
use prost_types::FileDescriptorSet;
use std::collections::HashSet;

/// Paths of the calls with one request and one answer, such as `/yoto.v1.JobService/GetJob`.
pub fn unary_paths() -> HashSet<String> {
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
    fn calls_with_streams_are_not_among_them() {
        let paths = unary_paths();
        assert!(paths.contains("/yoto.v1.WorkerService/EndJob"), "{paths:?}");
        assert!(!paths.contains("/yoto.v1.JobService/WatchJob"), "{paths:?}");
        assert!(!paths.contains("/yoto.v1.ObjectService/DownloadObject"));
    }
}
