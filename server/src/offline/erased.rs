//! Who was erased, for the restoration of a backup that still has them.

use super::on_host;
use crate::error::ServerError;
use serde::{Deserialize, Serialize};
use std::path::Path;
use yoto_proto::names::Collection;
use yoto_store::{PostgresUrl, Store, StoreError};

/// A person who was erased, without their name. A report of an erasure has these fields too.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ErasedPerson {
    /// `erasures/{id}`.
    pub erasure: String,
    /// `subjects/{id}`.
    pub subject: String,
}

/// All who were erased, or are being erased, in all tenants of the service in a data folder. It may run.
///
/// # Errors
/// When no service was in the folder, or one of an earlier version.
pub async fn erased_in_folder(folder: &Path) -> Result<Vec<ErasedPerson>, ServerError> {
    all(on_host::in_folder(folder).await?).await
}

/// The same of a service with a database of PostgreSQL.
///
/// # Errors
/// When the database can't be reached, or is in use by a coordinator of another version.
pub async fn erased_in_postgres(url: &PostgresUrl) -> Result<Vec<ErasedPerson>, ServerError> {
    all(on_host::in_postgres(url).await?).await
}

async fn all(store: Store) -> Result<Vec<ErasedPerson>, ServerError> {
    let found = store.all_erasures().await;
    store.close().await;
    let people = found?.into_iter().map(|it| ErasedPerson {
        erasure: it.name,
        subject: it.subject,
    });
    Ok(people.collect())
}

/// Begins an erasure of each of the `people` who is in the database. Returns their number. A coordinator carries it out.
///
/// # Errors
/// When the database fails.
pub(super) async fn erase_again(
    store: &Store,
    people: &[ErasedPerson],
) -> Result<usize, StoreError> {
    let mut begun = 0;
    for person in people {
        let Ok(id) = Collection::Subjects.parse(&person.subject) else {
            continue;
        };
        begun += usize::from(store.erase_again(id).await?);
    }
    Ok(begun)
}
