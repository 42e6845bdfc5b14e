//! Compares the files of an upload with their announced checksums: every part is read once, in order.

use crate::context::Context;
use futures::TryStreamExt;
use sha2::{Digest, Sha256};
use std::collections::{BTreeSet, HashMap};
use std::convert::Infallible;
use tokio::sync::mpsc;
use yoto_objects::{Extent, Part, Piece};
use yoto_proto::hex;
use yoto_request::RequestError;
use yoto_store::{StoredPart, UploadFile};

/// Pieces that are read ahead of the checksums.
const AHEAD: usize = 4;

/// The files that are not as announced.
#[derive(Debug, Default)]
pub(super) struct Faults {
    /// Files whose bytes the store has lost or altered.
    pub lost: BTreeSet<String>,
    /// Files that arrived with other bytes: path, announced and found SHA-256.
    pub others: Vec<(String, String, String)>,
}

/// The checksum of a file as far as it was read.
#[derive(Debug, Default, Clone)]
struct Hashed {
    bytes: u64,
    hash: Sha256,
}

/// Reads all `files` from their `parts`. The reading ends when this future is dropped: a client that repeats a call with a
/// short deadline must not start one after another.
///
/// # Errors
/// When the object store fails.
pub(super) async fn verify(
    context: &Context,
    files: &[UploadFile],
    parts: &[StoredPart],
) -> Result<Faults, RequestError> {
    let index: HashMap<&str, usize> = (files.iter().enumerate())
        .map(|(number, file)| (&*file.path, number))
        .collect();
    let (extents, received) = mpsc::channel(AHEAD);
    let count = files.len();
    let hashing = tokio::task::spawn_blocking(move || hash(count, received));
    let mut faults = Faults::default();
    for StoredPart { part, .. } in parts {
        // The checksums of the files tell more than that of the part.
        if let Err(error) = read(context, numbered(part, &index), &extents).await {
            if !error.is_torn() {
                return Err(error.into());
            }
            tracing::error!(%error, "bytes of an upload are lost");
            let files = part.pieces.iter().map(|piece| piece.file.clone());
            faults.lost.extend(files);
        }
    }
    drop(extents);
    let hashed = hashing.await.map_err(|error| {
        tracing::error!(%error, "the checksums of an upload ended early");
        RequestError::Stream(tonic::Status::internal("the checksums ended early"))
    })?;
    for (file, Hashed { bytes, hash }) in files.iter().zip(hashed) {
        let found = hex(&hash.finalize());
        if faults.lost.contains(&file.path) || found == file.sha256 {
            continue;
        }
        let altered = altered(context, &file.path, parts).await?;
        if bytes != file.bytes {
            faults.lost.insert(file.path.clone());
        } else if altered.is_empty() {
            let (path, announced) = (file.path.clone(), file.sha256.clone());
            faults.others.push((path, announced, found));
        }
        faults.lost.extend(altered);
    }
    Ok(faults)
}

/// `part` without its own checksum, and with the numbers of its files.
fn numbered(part: &Part<String>, index: &HashMap<&str, usize>) -> Part<usize> {
    let mut object = part.object.clone();
    object.sha256 = String::new();
    let pieces = part.pieces.iter().filter_map(|piece| {
        Some(Piece {
            file: *index.get(&*piece.file)?,
            offset: piece.offset,
            start: piece.start,
            bytes: piece.bytes,
        })
    });
    Part {
        object,
        pieces: pieces.collect(),
    }
}

/// Passes on the pieces of `part`.
async fn read(
    context: &Context,
    part: Part<usize>,
    to: &mpsc::Sender<Extent<usize>>,
) -> Result<(), yoto_objects::ObjectsError> {
    let mut extents = std::pin::pin!(context.objects.extents(part));
    while let Some(extent) = extents.try_next().await? {
        // Without a receiver, the checksums have ended early, which their caller finds.
        let _ = to.send(extent).await;
    }
    Ok(())
}

/// Checksums of `count` files of which `extents` arrive in order. What follows a gap does not count.
fn hash(count: usize, mut extents: mpsc::Receiver<Extent<usize>>) -> Vec<Hashed> {
    let mut files = vec![Hashed::default(); count];
    while let Some(extent) = extents.blocking_recv() {
        if let Some(file) = files.get_mut(extent.file)
            && file.bytes == extent.offset
        {
            file.hash.update(&extent.bytes);
            file.bytes += extent.bytes.len() as u64;
        }
    }
    files
}

/// The files of the parts with bytes of the file `path` that the store has altered. Those with the right bytes are among
/// them: an ingest job compares whole parts.
async fn altered(
    context: &Context,
    path: &str,
    parts: &[StoredPart],
) -> Result<BTreeSet<String>, RequestError> {
    let mut files = BTreeSet::new();
    let of_file = |it: &&StoredPart| it.part.pieces.iter().any(|piece| piece.file == path);
    for StoredPart { part, .. } in parts.iter().filter(of_file) {
        let ignore = |_| Ok::<(), Infallible>(());
        match context.objects.read_part(part.clone(), ignore).await {
            Ok(_) => {}
            Err(error) if error.is_torn() => {
                tracing::error!(path, %error, "bytes of an upload are altered");
                files.extend(part.pieces.iter().map(|it| it.file.clone()));
            }
            Err(error) => return Err(error.into()),
        }
    }
    Ok(files)
}
