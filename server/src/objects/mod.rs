//! The coordinator's side of the object store: free space, and collection of garbage.

pub mod checksum;
pub mod collect;
pub mod disk;
mod folders;
pub mod manifest;
pub mod place;
pub mod room;

use place::ObjectsPlace;
use url::Url;

/// Where the objects of a coordinator are.
#[derive(Debug)]
pub struct Storage {
    /// The URL, for workers to open.
    pub url: Url,
    /// The id of the object store: a random number that only the database and the store have.
    pub id: String,
    /// The place, for operations that the object store's interface lacks.
    pub place: ObjectsPlace,
}
