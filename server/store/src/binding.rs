//! An object that binds its store to one database: a coordinator finds by it whether the objects of its database are there,
//! and whether they belong to another one, whose objects would be garbage to it.

use crate::{Store, StoreError, new_id};
use thiserror::Error;
use url::Url;
use yoto_objects::{Objects, ObjectsError, shown};

/// The object's key. Its content is the id of the store.
pub const KEY: &str = "yoto-store";
/// What follows the id until the database has it too: a first start may end between the two.
const BEGUN: &str = "begun";

/// Database and object store don't belong together, or can't tell.
#[derive(Debug, Error)]
pub enum BindingError {
    /// The object store is not the one of the database.
    #[error(
        "the objects of this database are not at {url}: it was begun with another store, whose object {key} contains {id}; \
         name that store, or run `yoto adopt` if you have moved its objects to {url} or have lost them"
    )]
    OtherObjects {
        /// The store, without credentials.
        url: String,
        /// The object that names the store.
        key: &'static str,
        /// What it should contain.
        id: String,
    },
    /// The object store is another database's.
    #[error(
        "the objects at {url} belong to another database, as their object {key} says: name an empty bucket, prefix or folder, \
         or run `yoto adopt` if this database replaces that one"
    )]
    OtherDatabase {
        /// The store, without credentials.
        url: String,
        /// The object that names the store.
        key: &'static str,
    },
    /// The database.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The object store.
    #[error(transparent)]
    Objects(#[from] ObjectsError),
}

/// The object's content.
#[derive(Debug, PartialEq, Eq)]
struct Marker {
    id: String,
    /// Whether a database has this id.
    bound: bool,
}

/// Refuses the object store at `url` if the database was begun with another one, or the store belongs to another database. Returns the id
/// of the store.
///
/// # Errors
/// [`BindingError::OtherObjects`], [`BindingError::OtherDatabase`], or when the store or the database fails.
pub async fn check(objects: &Objects, url: &Url, store: &Store) -> Result<String, BindingError> {
    // Coordinators of one database do this one after the other, so it needs no conditional write, which not all stores know.
    let id = store.object_store(|| begin(objects, url)).await??;
    match found(objects).await? {
        Some(marker) if marker.id == id && !marker.bound => put(objects, &id).await?,
        found => is_of(found, url, &id)?,
    }
    Ok(id)
}

/// Refuses the object store at `url` if it is not the one called `id`. Nothing is written.
///
/// # Errors
/// [`BindingError::OtherObjects`], or when the store fails.
pub async fn belong(objects: &Objects, url: &Url, id: &str) -> Result<(), BindingError> {
    is_of(found(objects).await?, url, id)
}

fn is_of(found: Option<Marker>, url: &Url, id: &str) -> Result<(), BindingError> {
    match found {
        Some(marker) if marker.id == id => Ok(()),
        _ => Err(BindingError::OtherObjects {
            url: shown(url).to_string(),
            key: KEY,
            id: id.to_owned(),
        }),
    }
}

/// Binds the store to the database, whatever it was bound to before.
///
/// # Errors
/// When the store or the database fails.
pub async fn adopt(objects: &Objects, store: &Store) -> Result<String, BindingError> {
    let id = store.object_store(async || Ok::<_, BindingError>(new_id()));
    let id = id.await??;
    put(objects, &id).await?;
    Ok(id)
}

/// A new id for the store, unless a database has it.
async fn begin(objects: &Objects, url: &Url) -> Result<String, BindingError> {
    if let Some(Marker { bound: true, .. }) = found(objects).await? {
        return Err(BindingError::OtherDatabase {
            url: shown(url).to_string(),
            key: KEY,
        });
    }
    let id = new_id();
    objects.put(KEY, format!("{id} {BEGUN}").into()).await?;
    Ok(id)
}

/// Records that a database has the id.
async fn put(objects: &Objects, id: &str) -> Result<(), ObjectsError> {
    objects.put(KEY, id.to_owned().into()).await.map(drop)
}

async fn found(objects: &Objects) -> Result<Option<Marker>, ObjectsError> {
    let found = objects.find(KEY).await?;
    Ok(found.map(|content| {
        let content = String::from_utf8_lossy(&content);
        let (id, rest) = content
            .trim()
            .split_once(' ')
            .unwrap_or((content.trim(), ""));
        Marker {
            id: id.to_owned(),
            bound: rest != BEGUN,
        }
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stage::{DatabaseKind, on_each_database};
    use object_store::memory::InMemory;
    use std::sync::Arc;
    use yoto_process::clock::{Clock, ManualClock};

    on_each_database!(
        the_first_coordinator_decides,
        a_store_belongs_to_one_database,
        a_first_start_that_broke_off_is_repeated,
        an_operator_can_bind_a_store_anew,
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

    async fn the_first_coordinator_decides(kind: DatabaseKind) {
        let (staged, ours, other) = (kind.store(clock()).await, objects(), objects());
        // The second time as after a restart.
        for _ in 0..2 {
            let checked = check(&ours, &url(), &staged.store).await;
            checked.expect("they belong together");
        }
        let refused = check(&other, &url(), &staged.store).await;
        let refused = refused.expect_err("is another store").to_string();
        let id = found(&ours).await.expect("reads").expect("has one").id;
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

    async fn a_store_belongs_to_one_database(kind: DatabaseKind) {
        let (first, second, objects) = (
            kind.store(clock()).await,
            kind.store(clock()).await,
            objects(),
        );
        let begun = check(&objects, &url(), &first.store).await;
        begun.expect("nobody has it");
        for _ in 0..2 {
            let refused = check(&objects, &url(), &second.store).await;
            let refused = refused.expect_err("the first one has it");
            assert!(
                matches!(refused, BindingError::OtherDatabase { .. }),
                "{refused}"
            );
        }
        let same = check(&objects, &url(), &first.store).await;
        same.expect("nothing has changed");
        let free = super::tests::objects();
        let begun = check(&free, &url(), &second.store).await;
        begun.expect("the refusal has left nothing in the database");
    }

    async fn a_first_start_that_broke_off_is_repeated(kind: DatabaseKind) {
        let (staged, objects) = (kind.store(clock()).await, objects());
        // Before the database has the id.
        begin(&objects, &url()).await.expect("writes");
        let again = check(&objects, &url(), &staged.store).await;
        again.expect("no database has that id");
        // Before the object says that the database has it.
        let id = found(&objects).await.expect("reads").expect("has one").id;
        let begun = format!("{id} {BEGUN}");
        objects.put(KEY, begun.into()).await.expect("writes");
        let again = check(&objects, &url(), &staged.store).await;
        again.expect("it is this database's id");
        let bound = found(&objects).await.expect("reads");
        assert_eq!(bound, Some(Marker { id, bound: true }));
    }

    async fn an_operator_can_bind_a_store_anew(kind: DatabaseKind) {
        let (first, second) = (kind.store(clock()).await, kind.store(clock()).await);
        let (lost, new) = (objects(), objects());
        let begun = check(&lost, &url(), &first.store).await;
        begun.expect("nobody has it");
        let refused = check(&new, &url(), &first.store).await;
        refused.expect_err("the objects are not there");
        let id = adopt(&new, &first.store).await.expect("binds");
        let taken = check(&new, &url(), &first.store).await;
        taken.expect("is bound to it");
        // A database that replaces the other one.
        let other = adopt(&new, &second.store).await.expect("binds");
        assert_ne!(id, other);
        let taken = check(&new, &url(), &second.store).await;
        taken.expect("is bound to it");
        let gone = check(&new, &url(), &first.store).await;
        gone.expect_err("is bound to the second one");
    }

    async fn coordinators_that_start_at_once_agree(kind: DatabaseKind) {
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
