//! The coordinator's side of the object store: free space, and collection of garbage.

pub mod checksum;
pub mod collect;
pub mod disk;
mod folders;
pub mod manifest;
pub mod place;
pub mod room;
