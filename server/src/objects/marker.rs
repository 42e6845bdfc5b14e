//! An object that names its store, so that a coordinator finds whether the objects of its database are there.

use crate::error::ServerError;
use crate::store::{Store, new_id};
use url::Url;
use yoto_objects::{Objects, ObjectsError, shown};

/// The object's key. Its content is the id of the store.
pub const KEY: &str = "yoto-store";

/// Refuses the object store at `url` if the database was begun with another one. The first coordinator of a database
/// decides: it takes the id that it finds, or writes one. Returns the id of the store.
///
/// # Errors
/// [`ServerError::OtherObjects`], or when the store or the database fails.
pub async fn check(objects: &Objects, url: &Url, store: &Store) -> Result<String, ServerError> {
    // Coordinators of one database do this one after the other, so it needs no conditional write, which not all stores know.
    let id = store.object_store(|| mark(objects)).await??;
    match found(objects).await? {
        Some(found) if found == id => Ok(id),
        _ => Err(ServerError::OtherObjects {
            url: shown(url).to_string(),
            key: KEY,
            id,
        }),
    }
}

/// The id of the store, which gets one if it has none yet.
async fn mark(objects: &Objects) -> Result<String, ObjectsError> {
    if let Some(id) = found(objects).await? {
        return Ok(id);
    }
    let id = new_id();
    objects.put(KEY, id.clone().into()).await?;
    Ok(id)
}

/// The id of the store, if it has one yet.
async fn found(objects: &Objects) -> Result<Option<String>, ObjectsError> {
    let found = objects.find(KEY).await?;
    Ok(found.map(|it| String::from_utf8_lossy(&it).trim().to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::{Clock, ManualClock};
    use crate::store::stage::{Kind, on_each_database};
    use object_store::memory::InMemory;
    use std::sync::Arc;

    on_each_database!(
        the_first_coordinator_decides,
        coordinators_that_start_at_once_agree
    );

    fn clock() -> Arc<dyn Clock> {
        Arc::new(ManualClock::at(1e9))
    }

    fn objects() -> Objects {
        Objects::over(Arc::new(InMemory::new()))
    }

    fn url() -> Url {
        Url::parse("s3://bucket/prefix").expect("a URL")
    }

    async fn the_first_coordinator_decides(kind: Kind) {
        let (staged, ours, other) = (kind.store(clock()).await, objects(), objects());
        // The second time as after a restart.
        for _ in 0..2 {
            let checked = check(&ours, &url(), &staged.store).await;
            checked.expect("they belong together");
        }
        let refused = check(&other, &url(), &staged.store).await;
        let refused = refused.expect_err("is another store").to_string();
        let id = found(&ours).await.expect("reads").expect("has one");
        assert!(refused.contains(&id), "{refused}");
        let left = found(&other).await.expect("reads");
        assert_eq!(left, None, "nothing was written there");

        // A store with other objects, and one to which they were moved.
        other.put(KEY, "other".into()).await.expect("writes");
        let refused = check(&other, &url(), &staged.store).await;
        refused.expect_err("is another store");
        other.put(KEY, id.into()).await.expect("writes");
        let moved = check(&other, &url(), &staged.store).await;
        moved.expect("has the name");
    }

    async fn coordinators_that_start_at_once_agree(kind: Kind) {
        for _ in 0..5 {
            let (pair, objects) = (kind.pair(clock()).await, objects());
            let url = url();
            let (first, second) = tokio::join!(
                check(&objects, &url, &pair.first),
                check(&objects, &url, &pair.second)
            );
            first.expect("they agree");
            second.expect("they agree");
        }
    }
}
