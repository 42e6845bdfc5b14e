//! Reads. One of a whole object ends with a comparison of checksums, so that every reader finds an altered
//! object.

use super::{Objects, ObjectsError, parse, same_size};
use bytes::Bytes;
use futures::stream::BoxStream;
use futures::{Stream, StreamExt, TryStreamExt, stream};
use object_store::{GetOptions, GetRange, ObjectStoreExt};
use sha2::{Digest, Sha256};
use std::ops::Range;
use std::path::Path;
use tokio::fs::File;
use tokio::io::AsyncWriteExt;
use yoto_proto::hex;
use yoto_proto::v1::ObjectRef;

type Chunks = BoxStream<'static, Result<Bytes, ObjectsError>>;

impl Objects {
    /// The whole of an object that fits into memory.
    ///
    /// # Errors
    /// When it is missing or differs from `object`, or the store fails.
    pub async fn read(&self, object: &ObjectRef) -> Result<Bytes, ObjectsError> {
        let (key, path) = (&object.key, parse(&object.key)?);
        let bytes = self.attempt("reading", key, || async {
            self.store.get(&path).await?.bytes().await
        });
        let bytes = bytes.await?;
        same_size(object, bytes.len() as u64)?;
        let mut hash = Sha256::new();
        hash.update(&bytes);
        same_bytes(object, hash)?;
        Ok(bytes)
    }

    /// All bytes of a small object, which are not compared with a checksum; `None` if it is missing.
    ///
    /// # Errors
    /// When the key is malformed or the store fails.
    pub async fn find(&self, key: &str) -> Result<Option<Bytes>, ObjectsError> {
        let path = parse(key)?;
        let bytes = self.attempt("reading", key, || async {
            self.store.get(&path).await?.bytes().await
        });
        match bytes.await {
            Err(ObjectsError::Missing { .. }) => Ok(None),
            found => found.map(Some),
        }
    }

    /// Reads the whole `object`, in little memory, and compares it with its size and its checksum.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub async fn verify(&self, object: &ObjectRef) -> Result<(), ObjectsError> {
        let (key, path) = (&object.key, parse(&object.key)?);
        let read = self.attempt("reading", key, || async {
            let mut chunks = self.store.get(&path).await?.into_stream();
            let (mut bytes, mut hash) = (0, Sha256::new());
            while let Some(chunk) = chunks.try_next().await? {
                bytes += chunk.len() as u64;
                hash.update(&chunk);
            }
            Ok((bytes, hash))
        });
        let (bytes, hash) = read.await?;
        same_size(object, bytes)?;
        same_bytes(object, hash)
    }

    /// The size of the object at `key`, or `None` if there is none.
    ///
    /// # Errors
    /// When the store fails.
    pub async fn size(&self, key: &str) -> Result<Option<u64>, ObjectsError> {
        let path = parse(key)?;
        let found = self.attempt("looking for", key, || self.store.head(&path));
        match found.await {
            Ok(found) => Ok(Some(found.size)),
            Err(ObjectsError::Missing { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Copies `object` into the file at `to`, so that one larger than memory can be read.
    ///
    /// # Errors
    /// As [`Self::read`]; [`ObjectsError::Disk`] when the file can't be written.
    pub async fn copy_to(&self, object: &ObjectRef, to: &Path) -> Result<(), ObjectsError> {
        let (key, from) = (&object.key, parse(&object.key)?);
        let disk = |cause| ObjectsError::Disk {
            action: "writing",
            path: to.to_owned(),
            cause,
        };
        // The store's faults are tried again; the disk's are not.
        let copied = self.attempt("reading", key, || async {
            let chunks = self.store.get(&from).await?.into_stream();
            write(chunks, to).await
        });
        let (bytes, hash) = copied.await?.map_err(disk)?;
        same_size(object, bytes)?;
        same_bytes(object, hash)
    }

    /// Streams the bytes of an object in `range`, which is not empty; all of them without one, and then the
    /// last item is an error if they are not those of `object`.
    ///
    /// # Errors
    /// When it is missing, its size differs from `object`, it has no such bytes, or the store fails.
    pub async fn stream(
        &self,
        object: &ObjectRef,
        range: Option<Range<u64>>,
    ) -> Result<Chunks, ObjectsError> {
        let (key, path) = (object.key.clone(), parse(&object.key)?);
        let is_whole = range.as_ref().is_none_or(|it| *it == (0..object.bytes));
        let options = GetOptions {
            range: range.map(GetRange::Bounded),
            ..GetOptions::default()
        };
        let found = self.attempt("reading", &key, || {
            self.store.get_opts(&path, options.clone())
        });
        let found = found.await?;
        same_size(object, found.meta.size)?;
        let chunks = found
            .into_stream()
            .map_err(move |cause| ObjectsError::of_store("reading", &key, cause))
            .boxed();
        Ok(match is_whole {
            true => checked(object.clone(), chunks).boxed(),
            false => chunks,
        })
    }
}

/// Bytes and checksum of what was copied; the inner error is the disk's.
async fn write(
    mut chunks: BoxStream<'static, object_store::Result<Bytes>>,
    to: &Path,
) -> object_store::Result<std::io::Result<(u64, Sha256)>> {
    let mut file = match File::create(to).await {
        Ok(file) => file,
        Err(error) => return Ok(Err(error)),
    };
    let (mut bytes, mut hash) = (0, Sha256::new());
    while let Some(chunk) = chunks.next().await {
        let chunk = chunk?;
        bytes += chunk.len() as u64;
        hash.update(&chunk);
        if let Err(error) = file.write_all(&chunk).await {
            return Ok(Err(error));
        }
    }
    Ok(file.flush().await.map(|()| (bytes, hash)))
}

/// `chunks`, which are all of `object`; after the last one, an error if their SHA-256 is another.
fn checked(
    object: ObjectRef,
    chunks: Chunks,
) -> impl Stream<Item = Result<Bytes, ObjectsError>> + Send + 'static {
    let start = (object, chunks, Sha256::new());
    stream::try_unfold(start, |(object, mut chunks, mut hash)| async move {
        if let Some(chunk) = chunks.try_next().await? {
            hash.update(&chunk);
            return Ok(Some((chunk, (object, chunks, hash))));
        }
        same_bytes(&object, hash).map(|()| None)
    })
}

pub(super) fn same_bytes(object: &ObjectRef, hash: Sha256) -> Result<(), ObjectsError> {
    let found = hex(&hash.finalize());
    if found == object.sha256 {
        return Ok(());
    }
    Err(ObjectsError::Altered {
        key: object.key.clone(),
        expected: object.sha256.clone(),
        found,
    })
}
