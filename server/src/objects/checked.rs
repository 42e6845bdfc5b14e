//! Reads that end with a comparison of checksums: an altered object is found by whoever reads it whole.

use super::{Objects, ObjectsError};
use bytes::Bytes;
use futures::{Stream, TryStreamExt, stream, stream::BoxStream};
use sha2::{Digest, Sha256};
use yoto_proto::{hex, v1::ObjectRef};

type Chunks = BoxStream<'static, Result<Bytes, ObjectsError>>;

impl Objects {
    /// The whole of an object that fits into memory.
    ///
    /// # Errors
    /// When it is missing or differs from `object`, or the store fails.
    pub async fn read(&self, object: &ObjectRef) -> Result<Vec<u8>, ObjectsError> {
        let chunks: Vec<Bytes> = self.get(object).await?.try_collect().await?;
        Ok(chunks.concat())
    }
}

/// `chunks`, which are all of `object`; after the last one, an error if their SHA-256 is another.
pub(super) fn checked(
    object: &ObjectRef,
    chunks: Chunks,
) -> impl Stream<Item = Result<Bytes, ObjectsError>> + Send + 'static {
    let (key, expected) = (object.key.clone(), object.sha256.clone());
    stream::try_unfold((chunks, Sha256::new()), move |(mut chunks, mut hash)| {
        let (key, expected) = (key.clone(), expected.clone());
        async move {
            if let Some(chunk) = chunks.try_next().await? {
                hash.update(&chunk);
                return Ok(Some((chunk, (chunks, hash))));
            }
            let found = hex(&hash.finalize());
            match found == expected {
                true => Ok(None),
                false => Err(ObjectsError::Altered {
                    key,
                    expected,
                    found,
                }),
            }
        }
    })
}
