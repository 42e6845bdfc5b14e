//! The coordinator's side of the object store: free space, and collection of garbage.

pub(crate) mod checksum;
pub(crate) mod collect;
pub(crate) mod disk;
mod folders;
pub(crate) mod manifest;
pub(crate) mod place;
pub(crate) mod room;

use place::ObjectsPlace;
use url::Url;

/// Where the objects of a coordinator are.
#[derive(Debug)]
pub(crate) struct Storage {
    /// The URL, for workers to open.
    pub url: Url,
    /// The id of the object store: a random number that only the database and the store have.
    pub id: String,
    /// The place, for operations that the object store's interface lacks.
    pub place: ObjectsPlace,
}
