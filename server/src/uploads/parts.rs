//! Parts that the client puts into the object store by itself, by URLs that the coordinator signs.
//!
//! The number of the writer reserves the keys of all its parts, so that no row is needed before a part is committed. What is
//! never committed is left behind as by a coordinator that was killed, and the next collection removes it. A URL may be
//! used once more after the commit: the row has the SHA-256 that was signed, and whoever reads the part compares it.

use super::take_over;
use crate::context::Context;
use crate::objects::checksum::sha256;
use std::time::Duration;
use yoto_process::metrics::METRICS;
use yoto_proto::keys;
use yoto_proto::limits::{LEAST_PART, PART_FILES, SIGNED_PARTS};
use yoto_proto::v1::{
    self, CommitPartRequest, ErrorReason, ObjectRef, SignPartsResponse, SignedPart, Unsigned,
};
use yoto_request::RequestError;
use yoto_request::validation::all;
use yoto_store::{NewPart, NewPiece, PartId, Tenant};

/// Longest time for which a part can be written: its client has the bytes and begins at once.
const LIFE: Duration = Duration::from_secs(120);

/// Signs URLs of `parts` for the writer with this number, or for a new writer (0).
///
/// # Errors
/// When there is no such upload, it is finished, another writer has taken it over, a part is invalid, or the store's
/// credentials can't be had.
pub(crate) async fn sign_parts(
    context: &Context,
    tenant: &Tenant,
    id: &str,
    writer: u64,
    parts: &[v1::NewPart],
) -> Result<SignPartsResponse, RequestError> {
    context.store.require_upload(tenant, id).await?;
    let without = |reason: Unsigned| {
        Ok(SignPartsResponse {
            unsigned: reason.into(),
            ..SignPartsResponse::default()
        })
    };
    let Some(life) = context.config.signed_urls else {
        return without(Unsigned::TurnedOff);
    };
    if !context.objects.signs() {
        return without(Unsigned::NotSupported);
    }
    let checksums = check(context, parts)?;
    let writer = match writer {
        0 => take_over(context, tenant, id).await?.1,
        writer => writer,
    };
    context.store.require_writer(tenant, id, writer).await?;
    let life = life.min(LIFE);
    let end = context.config.clock.time() + life;
    let mut signed = Vec::with_capacity(parts.len());
    for (part, checksum) in parts.iter().zip(&checksums) {
        let key = keys::upload_part(id, writer, part.number.into());
        let Some(put) = context.objects.signed_put(&key, checksum, life).await? else {
            return without(Unsigned::NotSupported);
        };
        signed.push(SignedPart {
            url: put.url.into(),
            headers: put.headers.into_iter().collect(),
        });
    }
    Ok(SignPartsResponse {
        writer,
        parts: signed,
        expire_time: Some(end.into()),
        ..SignPartsResponse::default()
    })
}

/// Commits a part whose object its client has written.
///
/// # Errors
/// When there is no such upload, the object has not arrived or has another size, the pieces don't follow the committed bytes,
/// or another writer has taken over. The object stays: an earlier call may have committed it.
pub(crate) async fn commit_part(
    context: &Context,
    tenant: &Tenant,
    id: &str,
    request: CommitPartRequest,
) -> Result<(), RequestError> {
    context.store.require_upload(tenant, id).await?;
    let CommitPartRequest {
        writer,
        part,
        pieces,
        ..
    } = request;
    let part = part.unwrap_or_default();
    check_part(context, "part", &part)?;
    let pieces = check_pieces(&part, pieces)?;
    let key = keys::upload_part(id, writer, part.number.into());
    let found = context.objects.size(&key).await?;
    if found != Some(part.bytes) {
        // A collection removes what a writer has put that was taken over.
        context.store.require_writer(tenant, id, writer).await?;
        let (number, expected) = (part.number, part.bytes);
        let message = match found {
            Some(found) => format!("part {number} has {found} bytes in the store, not {expected}"),
            None => format!("part {number} is not in the store"),
        };
        return Err(RequestError::precondition(
            ErrorReason::UploadIncomplete,
            message,
        ));
    }
    let new = NewPart {
        id: PartId {
            writer,
            number: part.number.into(),
        },
        object: ObjectRef {
            key,
            bytes: part.bytes,
            sha256: part.sha256,
        },
        pieces,
        replaces: None,
    };
    let store = &context.store;
    if store.commit_signed_part(tenant, id, &new).await? {
        METRICS.uploaded(new.object.bytes as usize);
    }
    Ok(())
}

/// The checksums of `parts`, which are as many as one call may sign.
fn check(context: &Context, parts: &[v1::NewPart]) -> Result<Vec<[u8; 32]>, RequestError> {
    if parts.is_empty() || parts.len() > SIGNED_PARTS {
        let message = format!("{} parts; a call has 1 to {SIGNED_PARTS}", parts.len());
        return Err(RequestError::invalid("parts", message));
    }
    let checked = parts.iter().enumerate();
    all(checked.map(|(at, part)| check_part(context, &format!("parts[{at}]"), part)))
}

/// The checksum of a part, whose size and checksum can be right; `field` is its path in the request.
fn check_part(
    context: &Context,
    field: &str,
    part: &v1::NewPart,
) -> Result<[u8; 32], RequestError> {
    let most = context.config.upload.part_bytes;
    let least = (most / LEAST_PART).max(1);
    if !(least..=most).contains(&part.bytes) {
        let message = format!(
            "{} bytes; a part has {least} to {most}, and a stream takes what is smaller",
            part.bytes
        );
        return Err(RequestError::invalid(format!("{field}.bytes"), message));
    }
    sha256(&part.sha256).ok_or_else(|| {
        let message = "a SHA-256 is 64 hex digits in lower case";
        RequestError::invalid(format!("{field}.sha256"), message)
    })
}

/// The pieces of `part`, which are all of its bytes.
fn check_pieces(
    part: &v1::NewPart,
    pieces: Vec<v1::PartPiece>,
) -> Result<Vec<NewPiece>, RequestError> {
    let refuse = |message: String| Err(RequestError::invalid("pieces", message));
    if pieces.len() > PART_FILES {
        let message = format!("{} pieces; a part has at most {PART_FILES}", pieces.len());
        return refuse(message);
    }
    let sum = pieces
        .iter()
        .try_fold(0_u64, |sum, it| sum.checked_add(it.bytes));
    if sum != Some(part.bytes) || pieces.iter().any(|it| it.bytes == 0) {
        return refuse(format!(
            "each has bytes, and together those of the part, {}",
            part.bytes
        ));
    }
    let checked = pieces.into_iter().map(|it| {
        let to = it.offset.checked_add(it.bytes)?;
        Some(NewPiece {
            path: it.path,
            from: it.offset,
            to,
        })
    });
    match checked.collect::<Option<Vec<_>>>() {
        Some(pieces) => Ok(pieces),
        None => refuse("an offset is too large".into()),
    }
}
