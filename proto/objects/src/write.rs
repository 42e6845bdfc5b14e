//! Writes. A large object goes to a remote store in parts, so that a fault costs one part and not all of it.

use super::{Objects, ObjectsError, parse};
use bytes::Bytes;
use futures::{Stream, TryStreamExt, stream};
use object_store::path::Path as Key;
use object_store::{MultipartUpload, ObjectStoreExt};
use tokio::runtime::Handle;
use yoto_proto::sha256_hex;
use yoto_proto::v1::ObjectRef;

/// Bytes of a part. S3 wants at least 5 MiB and at most 10,000 parts, and R2 equal ones: the largest object has 80 GiB.
/// A part must arrive within [`crate::s3`]'s time limit of an answer.
pub(crate) const PART_BYTES: usize = 8 << 20;
/// Parts of an object that are on their way at once.
const PARTS_AT_ONCE: usize = 4;

impl Objects {
    /// Writes a complete object, and gives it its checksum.
    ///
    /// # Errors
    /// When the key is malformed or the store fails.
    pub async fn put(&self, key: &str, bytes: Bytes) -> Result<ObjectRef, ObjectsError> {
        let path = parse(key)?;
        let in_parts = self.remote.is_some() && bytes.len() > 2 * PART_BYTES;
        self.attempt("writing", key, || async {
            match in_parts {
                true => self.put_parts(&path, parts(&bytes)).await,
                false => self.store.put(&path, bytes.clone().into()).await.map(drop),
            }
        })
        .await?;
        Ok(ObjectRef {
            key: key.into(),
            bytes: bytes.len() as u64,
            sha256: sha256_hex(&bytes),
        })
    }

    async fn put_parts(
        &self,
        path: &Key,
        parts: impl Stream<Item = object_store::Result<Bytes>>,
    ) -> object_store::Result<()> {
        let mut upload = Parts(Some(self.store.put_multipart(path).await?));
        let Some(open) = upload.0.as_mut() else {
            return Ok(());
        };
        let sent = parts
            .map_ok(|part| open.put_part(part.into()))
            .try_buffer_unordered(PARTS_AT_ONCE)
            .try_collect::<()>();
        match sent.await {
            Ok(()) => open.complete().await?,
            Err(error) => {
                upload.abort().await;
                return Err(error);
            }
        };
        upload.0 = None;
        Ok(())
    }
}

fn parts(bytes: &Bytes) -> impl Stream<Item = object_store::Result<Bytes>> {
    let starts = (0..bytes.len()).step_by(PART_BYTES);
    stream::iter(starts.map(|at| Ok(bytes.slice(at..bytes.len().min(at + PART_BYTES)))))
}

/// An upload in parts that is not complete. Its parts are no object, but take room in the store until it is aborted.
struct Parts(Option<Box<dyn MultipartUpload>>);

impl Parts {
    async fn abort(&mut self) {
        if let Some(upload) = self.0.take() {
            abort(upload).await;
        }
    }
}

impl Drop for Parts {
    /// The caller no longer waits, such as a job that has lost its lease, or the end of the upload failed.
    fn drop(&mut self) {
        if let (Some(upload), Ok(runtime)) = (self.0.take(), Handle::try_current()) {
            runtime.spawn(abort(upload));
        }
    }
}

async fn abort(mut upload: Box<dyn MultipartUpload>) {
    if let Err(error) = upload.abort().await {
        tracing::warn!(%error, "parts of an object that was not completed stay in the store");
    }
}
