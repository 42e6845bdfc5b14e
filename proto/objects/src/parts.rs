//! Files in pieces: an object, called a part, has consecutive bytes of one or more files. Parts are read in windows that
//! fit into memory, however large they are.

use super::read::same_bytes;
use super::{Objects, ObjectsError, parse};
use bytes::Bytes;
use futures::{Stream, StreamExt, TryStreamExt, stream};
use object_store::{GetOptions, GetRange, ObjectStoreExt, PutPayload};
use sha2::{Digest, Sha256};
use std::ops::Range;
use yoto_proto::hex;
use yoto_proto::v1::ObjectRef;

/// Bytes that are read at once: most parts are read whole.
const WINDOW: u64 = 16 << 20;

/// Bytes of a file that follow each other in a part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Piece<F> {
    /// The file, as its reader calls it.
    pub file: F,
    /// Offset of the first byte in the file.
    pub offset: u64,
    /// Offset of the first byte in the part.
    pub start: u64,
    /// Number of bytes.
    pub bytes: u64,
}

/// An object with pieces of files.
#[derive(Debug, Clone)]
pub struct Part<F> {
    /// The object. It may have more bytes than are told here, which belong to no file. Without a SHA-256, its bytes are not
    /// compared.
    pub object: ObjectRef,
    /// Its pieces in their order in the object.
    pub pieces: Vec<Piece<F>>,
}

/// Bytes of a file at an offset.
#[derive(Debug, Clone)]
pub struct Extent<F> {
    /// The file.
    pub file: F,
    /// Offset of the first byte in the file.
    pub offset: u64,
    /// The bytes.
    pub bytes: Bytes,
}

impl Objects {
    /// Writes an object of `chunks`, one after the other.
    ///
    /// # Errors
    /// When the key is malformed or the store fails.
    pub async fn put_chunks(&self, key: &str, chunks: &[Bytes]) -> Result<ObjectRef, ObjectsError> {
        let path = parse(key)?;
        let payload: PutPayload = chunks.iter().cloned().collect();
        let bytes = payload.content_length() as u64;
        let mut hash = Sha256::new();
        chunks.iter().for_each(|it| hash.update(it));
        let put = || self.store.put(&path, payload.clone());
        self.attempt("writing", key, put).await?;
        Ok(ObjectRef {
            key: key.into(),
            bytes,
            sha256: hex(&hash.finalize()),
        })
    }

    /// The bytes in `range` of an object, which is not empty. They are not compared with a checksum.
    ///
    /// # Errors
    /// When it is missing or has fewer bytes, or the store fails.
    pub async fn window(&self, key: &str, range: Range<u64>) -> Result<Bytes, ObjectsError> {
        let (path, expected) = (parse(key)?, range.end);
        let options = GetOptions {
            range: Some(GetRange::Bounded(range.clone())),
            ..GetOptions::default()
        };
        let short = |found| ObjectsError::Size {
            key: key.to_owned(),
            expected,
            found,
        };
        let read = self.attempt("reading", key, || async {
            match self.store.get_opts(&path, options.clone()).await {
                Ok(found) if found.meta.size < expected => Ok(Err(found.meta.size)),
                Ok(found) => found.bytes().await.map(Ok),
                // Stores refuse a range that begins after the last byte, each with an error of its own.
                Err(error) => match self.store.head(&path).await?.size {
                    size if size < expected => Ok(Err(size)),
                    _ => Err(error),
                },
            }
        });
        let bytes = read.await?.map_err(short)?;
        match bytes.len() as u64 {
            length if length == range.end - range.start => Ok(bytes),
            length => Err(short(range.start + length)),
        }
    }

    /// The bytes of the pieces of `part` in their order. After the last ones, an error if the SHA-256 of the part is another
    /// than was told.
    ///
    /// # Errors
    /// The stream ends with an error when the part is missing, has fewer bytes or is altered, or the store fails.
    pub fn extents<F: Clone + Send + Sync + 'static>(
        &self,
        part: Part<F>,
    ) -> impl Stream<Item = Result<Extent<F>, ObjectsError>> + Send + use<F> {
        let objects = self.clone();
        let start = (part, 0, Sha256::new());
        stream::try_unfold(start, move |(part, at, mut hash)| {
            let objects = objects.clone();
            async move {
                let Part { object, pieces } = &part;
                if at >= object.bytes {
                    return Ok(None);
                }
                let end = object.bytes.min(at + WINDOW);
                let window = objects.window(&object.key, at..end).await?;
                if !object.sha256.is_empty() {
                    hash.update(&window);
                }
                let mut extents = inside(pieces, at..end, &window);
                if end == object.bytes && !object.sha256.is_empty() {
                    let finished = std::mem::take(&mut hash);
                    extents.extend(same_bytes(object, finished).err().map(Err));
                }
                Ok(Some((stream::iter(extents), (part, end, hash))))
            }
        })
        .try_flatten()
        .boxed()
    }

    /// Hands the bytes of the pieces of `part` to `take`, in their order. The inner error is that of `take`, which ends the
    /// reading.
    ///
    /// # Errors
    /// As the stream of [`Self::extents`].
    pub async fn read_part<F: Clone + Send + Sync + 'static, E>(
        &self,
        part: Part<F>,
        mut take: impl FnMut(Extent<F>) -> Result<(), E>,
    ) -> Result<Result<(), E>, ObjectsError> {
        let mut extents = std::pin::pin!(self.extents(part));
        while let Some(extent) = extents.try_next().await? {
            if let Err(error) = take(extent) {
                return Ok(Err(error));
            }
        }
        Ok(Ok(()))
    }
}

/// What the `window`, the bytes in `range` of a part, has of its `pieces`.
fn inside<F: Clone>(
    pieces: &[Piece<F>],
    range: Range<u64>,
    window: &Bytes,
) -> Vec<Result<Extent<F>, ObjectsError>> {
    let cut = pieces.iter().filter_map(|piece| {
        let start = piece.start.max(range.start);
        let end = (piece.start + piece.bytes).min(range.end);
        let bytes = (start - range.start) as usize..end.checked_sub(range.start)? as usize;
        (start < end).then(|| {
            Ok(Extent {
                file: piece.file.clone(),
                offset: piece.offset + (start - piece.start),
                bytes: window.slice(bytes),
            })
        })
    });
    cut.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use object_store::memory::InMemory;
    use std::sync::Arc;

    fn piece(file: &'static str, offset: u64, start: u64, bytes: u64) -> Piece<&'static str> {
        Piece {
            file,
            offset,
            start,
            bytes,
        }
    }

    async fn read(
        objects: &Objects,
        part: &Part<&'static str>,
    ) -> Result<Vec<(&'static str, u64, Bytes)>, ObjectsError> {
        let extents = objects.extents(part.clone());
        let extents = extents.map_ok(|it| (it.file, it.offset, it.bytes));
        extents.try_collect().await
    }

    #[tokio::test]
    async fn a_part_is_read_by_its_pieces_and_compared_with_its_checksum() {
        let objects = Objects::over(Arc::new(InMemory::new()));
        let chunks = ["abc", "", "defg"].map(Bytes::from);
        let object = objects.put_chunks("u/1", &chunks).await.expect("writes");
        assert_eq!(object.bytes, 7);
        assert_eq!(object.sha256, yoto_proto::sha256_hex(b"abcdefg"));
        let mut part = Part {
            object,
            // Byte 2 belongs to no file.
            pieces: vec![piece("a", 5, 0, 2), piece("b", 0, 3, 4)],
        };
        let found = read(&objects, &part).await.expect("reads");
        assert_eq!(found, [("a", 5, "ab".into()), ("b", 0, "defg".into())]);

        let written = objects.put("u/1", "abcdefX".into()).await;
        let altered = read(&objects, &part).await.expect_err("is altered");
        assert!(
            matches!(altered, ObjectsError::Altered { .. }),
            "{altered:?}"
        );
        // More bytes are none of the part, and without a checksum nothing is compared.
        part.object = written.expect("writes");
        part.object.sha256 = String::new();
        part.object.bytes = 6;
        let found = read(&objects, &part).await.expect("reads");
        assert_eq!(found[1].2, "def");
        part.object.bytes = 9;
        let short = read(&objects, &part).await.expect_err("is short");
        assert!(matches!(short, ObjectsError::Size { found: 7, .. }));
        objects.put("u/1", Bytes::new()).await.expect("writes");
        let short = read(&objects, &part).await.expect_err("is empty");
        assert!(matches!(short, ObjectsError::Size { found: 0, .. }));
        objects.delete("u/1").await.expect("is gone");
        let missing = read(&objects, &part).await.expect_err("is missing");
        assert!(matches!(missing, ObjectsError::Missing { .. }));
    }

    #[tokio::test]
    async fn a_part_larger_than_a_window_is_read_in_several() {
        let objects = Objects::over(Arc::new(InMemory::new()));
        let content = b"0123456789abcdefg".repeat(WINDOW as usize / 17 + 6);
        let content = content[..WINDOW as usize + 100].to_vec();
        let object = objects.put("u/1", content.clone().into()).await;
        let bytes = WINDOW + 40;
        let part = Part {
            object: object.expect("writes"),
            pieces: vec![piece("a", 7, 0, bytes), piece("b", 0, bytes, 60)],
        };
        let found = read(&objects, &part).await.expect("reads");
        let at: Vec<_> = found
            .iter()
            .map(|(file, offset, _)| (*file, *offset))
            .collect();
        assert_eq!(at, [("a", 7), ("a", 7 + WINDOW), ("b", 0)]);
        let all: Vec<Bytes> = found.into_iter().map(|it| it.2).collect();
        assert!(all.concat() == content, "byte for byte");
    }
}
