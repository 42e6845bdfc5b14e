//! `yoto.v1.StorageService`.

use crate::context::Context;
use crate::objects::collect::{self, Garbage};
use std::sync::Arc;
use tonic::{Request, Response, Status};
use yoto_proto::limits::LONGEST_PAGE_ENTRIES;
use yoto_proto::v1::storage_service_server::StorageService;
use yoto_proto::v1::{CollectGarbageRequest, CollectGarbageResponse, GarbageFolder};

/// The object store, for operators.
pub(crate) struct StorageApi {
    /// The shared parts.
    pub context: Arc<Context>,
}

#[tonic::async_trait]
impl StorageService for StorageApi {
    async fn collect_garbage(
        &self,
        request: Request<CollectGarbageRequest>,
    ) -> Result<Response<CollectGarbageResponse>, Status> {
        // For the operator: garbage belongs to no tenant.
        let CollectGarbageRequest { dry_run, now } = *request.get_ref();
        let options = collect::Options { dry_run, now };
        let mut found = collect::collect(&self.context, options).await?;
        found.sort_by_key(|it| std::cmp::Reverse(it.folder.bytes));
        let bytes = |it: &Garbage| it.folder.bytes;
        let grace = self.context.config.storage.grace;
        Ok(Response::new(CollectGarbageResponse {
            count: found.len() as u64,
            bytes: found.iter().map(bytes).sum(),
            due_bytes: found.iter().filter(|it| it.due).map(bytes).sum(),
            grace_seconds: grace.as_secs_f64(),
            folders: found
                .into_iter()
                .take(LONGEST_PAGE_ENTRIES as usize)
                .map(listed)
                .collect(),
        }))
    }
}

fn listed(found: Garbage) -> GarbageFolder {
    GarbageFolder {
        key: found.folder.key,
        files: found.folder.files,
        bytes: found.folder.bytes,
        deleted: found.deleted,
        age_seconds: found.age,
        due: found.due,
    }
}
