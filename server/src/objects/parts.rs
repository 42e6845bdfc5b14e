//! Files that are written piece by piece, each piece durable before the next begins.
//!
//! An object of the store appears as a whole or not at all; a file of an upload grows, and the catalogue
//! says how much of it counts. Bytes after that were never acknowledged and are overwritten.

use super::disk::{ObjectDisk, failed};
use crate::private;
use bytes::Bytes;
use sha2::{Digest, Sha256};
use std::collections::HashSet;
use std::fs::File;
use std::io::{self, ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Weak};
use yoto_objects::ObjectsError;
use yoto_proto::hex;

/// Bytes that are read at once.
const READ_BYTES: usize = 1 << 20;

/// A piece of a file.
#[derive(Debug, Clone)]
pub struct Piece {
    /// Key of the file.
    pub key: String,
    /// Offset of its first byte in the file; the bytes before it are written already.
    pub offset: u64,
    /// The bytes, in order.
    pub chunks: Vec<Bytes>,
}

impl ObjectDisk {
    /// Writes pieces of different files; they are on disk when this returns.
    ///
    /// # Errors
    /// [`ObjectsError::Size`] when the file is shorter than the offset of its piece, or missing; another error when
    /// the disk fails.
    pub async fn write_pieces(&self, pieces: Vec<Piece>) -> Result<(), ObjectsError> {
        let root = self.root.clone();
        blocking(move || write_all(&root, &pieces)).await
    }

    /// SHA-256 of the file `key`, which has `bytes` bytes. The reading ends when this future is dropped: a client that
    /// repeats a call with a short deadline must not start one after another.
    ///
    /// # Errors
    /// [`ObjectsError::Size`] when it has another size, 0 if it is missing; another error when the disk fails.
    pub async fn sha256(&self, key: &str, bytes: u64) -> Result<String, ObjectsError> {
        let (path, key) = (self.root.join(key), key.to_owned());
        let wanted = Arc::new(());
        let still = Arc::downgrade(&wanted);
        let hashed = blocking(move || {
            let (found, sha256) = match hash(&path, &still) {
                Err(error) if error.kind() == ErrorKind::NotFound => (0, String::new()),
                hashed => hashed.map_err(|error| failed("reading", &path, error))?,
            };
            if found != bytes {
                return Err(ObjectsError::Size {
                    key,
                    expected: bytes,
                    found,
                });
            }
            Ok(sha256)
        })
        .await;
        drop(wanted);
        hashed
    }
}

/// Runs `work` where it may block.
async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, ObjectsError> + Send + 'static,
) -> Result<T, ObjectsError> {
    let done = tokio::task::spawn_blocking(work).await;
    done.unwrap_or_else(|error| {
        Err(failed(
            "writing",
            Path::new("uploads"),
            io::Error::other(error),
        ))
    })
}

fn write_all(root: &Path, pieces: &[Piece]) -> Result<(), ObjectsError> {
    let mut files = Vec::with_capacity(pieces.len());
    let mut folders = HashSet::new();
    for piece in pieces {
        let path = root.join(&piece.key);
        files.push((piece, write(&path, piece)?));
        if piece.offset == 0 {
            // A new name is durable once its folder is synced, and a new folder once its parent is, up to the
            // root.
            let above = path.ancestors().skip(1);
            folders.extend(
                above
                    .take_while(|it| it.starts_with(root))
                    .map(PathBuf::from),
            );
        }
    }
    // After all writes: the first sync of several small files carries the others along.
    for (piece, file) in files {
        let synced = file.sync_data();
        synced.map_err(|error| failed("writing", &root.join(&piece.key), error))?;
    }
    for folder in folders {
        let synced = sync_folder(&folder);
        synced.map_err(|error| failed("writing", &folder, error))?;
    }
    Ok(())
}

fn write(path: &Path, piece: &Piece) -> Result<File, ObjectsError> {
    let failed = |error| failed("writing", path, error);
    if let (0, Some(folder)) = (piece.offset, path.parent()) {
        private::create_dir_all(folder).map_err(failed)?;
    }
    let opened = private::writable()
        .create(piece.offset == 0)
        .truncate(false)
        .open(path);
    let mut file = match opened {
        // The bytes before the piece are lost.
        Err(error) if piece.offset > 0 && error.kind() == ErrorKind::NotFound => {
            return Err(short(piece, 0));
        }
        opened => opened.map_err(failed)?,
    };
    let found = file.metadata().map_err(failed)?.len();
    if found < piece.offset {
        return Err(short(piece, found));
    }
    append(&mut file, found, piece).map_err(failed)?;
    Ok(file)
}

/// The error when a file has only `found` bytes, fewer than the offset of `piece`.
fn short(piece: &Piece, found: u64) -> ObjectsError {
    ObjectsError::Size {
        key: piece.key.clone(),
        expected: piece.offset,
        found,
    }
}

/// Writes `piece` into its file, which has `found` bytes, and drops all bytes after its offset.
fn append(file: &mut File, found: u64, piece: &Piece) -> io::Result<()> {
    if found > piece.offset {
        file.set_len(piece.offset)?;
    }
    file.seek(SeekFrom::Start(piece.offset))?;
    piece.chunks.iter().try_for_each(|it| file.write_all(it))
}

/// A folder can't be opened as a file on Windows, where a rename or a new name is durable by itself.
fn sync_folder(folder: &Path) -> io::Result<()> {
    match cfg!(unix) {
        true => File::open(folder)?.sync_all(),
        false => Ok(()),
    }
}

/// Bytes and SHA-256 of a file; an error once nothing is `wanted` any more.
fn hash(path: &Path, wanted: &Weak<()>) -> io::Result<(u64, String)> {
    let (mut file, mut buffer) = (File::open(path)?, vec![0; READ_BYTES]);
    let (mut bytes, mut hash) = (0, Sha256::new());
    loop {
        if wanted.strong_count() == 0 {
            return Err(ErrorKind::Interrupted.into());
        }
        match file.read(&mut buffer)? {
            0 => return Ok((bytes, hex(&hash.finalize()))),
            read => {
                bytes += read as u64;
                hash.update(&buffer[..read]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn piece(offset: u64, bytes: &'static [u8]) -> Piece {
        Piece {
            key: "uploads/c/frames/0.png".into(),
            offset,
            chunks: vec![Bytes::from_static(bytes)],
        }
    }

    #[tokio::test]
    async fn a_piece_is_written_over_what_was_never_acknowledged() {
        let dir = tempfile::tempdir().expect("a folder");
        let objects = ObjectDisk::create(dir.path().to_owned()).expect("is there");
        let write = |piece| objects.write_pieces(vec![piece]);
        write(piece(0, b"0123456789")).await.expect("writes");
        write(piece(4, b"abc")).await.expect("writes");
        let path = dir.path().join("uploads/c/frames/0.png");
        assert_eq!(fs::read(&path).expect("reads"), b"0123abc");
        let gap = write(piece(8, b"x")).await.expect_err("byte 7 is missing");
        assert!(matches!(
            gap,
            ObjectsError::Size {
                expected: 8,
                found: 7,
                ..
            }
        ));
        let key = piece(0, b"").key;
        let sha256 = objects.sha256(&key, 7).await.expect("reads");
        assert_eq!(sha256, yoto_proto::sha256_hex(b"0123abc"));
        assert!(objects.sha256(&key, 8).await.is_err());
        let path = dir.path().join(&key);
        let unwanted = hash(&path, &Weak::new()).expect_err("nobody waits for it");
        assert_eq!(unwanted.kind(), ErrorKind::Interrupted);
        let missing = Piece {
            key: "uploads/c/none".into(),
            ..piece(3, b"x")
        };
        let gone = write(missing)
            .await
            .expect_err("what it follows is not there");
        assert!(matches!(gone, ObjectsError::Size { found: 0, .. }));
    }
}
