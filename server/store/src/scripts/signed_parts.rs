//! Parts that their writer has put into the object store by itself. Unlike one that the coordinator writes, such a part may
//! be committed twice, since its writer repeats the call, and in any order.

use super::upload_parts::{self, find, newest, pieces};
use super::uploads::require;
use crate::db::{Lock, Tx};
use crate::{NewPart, StoreError, Tenant};
use yoto_proto::limits::UPLOAD_PIECES;
use yoto_proto::v1::ErrorReason;

/// Records a part. Returns whether it is new: one that is recorded already, with the same bytes, is not changed.
pub(crate) async fn commit(
    tx: &mut Tx,
    tenant: &Tenant,
    id: &str,
    part: &NewPart,
) -> Result<bool, StoreError> {
    tx.lock(Lock::Capture(id)).await?;
    require(tx, tenant, id).await?;
    if let Some(found) = find(tx, id, part.id).await? {
        return match found.object == part.object {
            true => Ok(false),
            false => Err(refused(format!(
                "part {} is committed, with other bytes",
                part.id.number
            ))),
        };
    }
    // Readers take the parts by their numbers.
    let newest = newest(tx, id).await?.map(|it| it.id);
    if let Some(newest) = newest.filter(|it| it.writer == part.id.writer && *it > part.id) {
        return Err(refused(format!(
            "part {} is committed, and part {} comes before it",
            newest.number, part.id.number
        )));
    }
    let all = pieces(tx, id).await? + part.pieces.len() as u64;
    if all > UPLOAD_PIECES {
        return Err(StoreError::TooLarge {
            field: "pieces",
            value: all,
        });
    }
    upload_parts::commit(tx, tenant, id, part).await?;
    Ok(true)
}

fn refused(message: String) -> StoreError {
    StoreError::Rule {
        reason: ErrorReason::UploadOffset,
        message,
    }
}
